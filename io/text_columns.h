// A text cloud's columns: what separates them, and what a header calls them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/property_names.h"
#include "pipeline/base/error.h"

namespace rbvh {

/// An Error(kInput) that naming the columns would mend.
struct ColumnsUnknown : Error {
  using Error::Error;
};

/// Cuts a line into cells. Blanks in a row are one separator; with others cells may be empty.
class Cells {
 public:
  explicit Cells(char separator) : separator_(separator) {}
  const std::vector<std::string_view>& cut(std::string_view line);
  char separator() const { return separator_; }

 private:
  char separator_;
  std::vector<std::string_view> cells_;
};

/// A semicolon, a comma, a tab or a blank. A comma inside a number is a decimal one where blanks stand
/// between the numbers.
char separator_of(std::string_view line);

/// A number; with a decimal comma, where commas do not separate.
bool read_cell(std::string_view cell, char separator, double& value);

/// A comment's text without what starts it; nothing for other lines.
std::optional<std::string_view> comment_text(std::string_view line);

/// A name a column, in the columns' order, some perhaps empty; and where the position is among them.
struct ColumnNames {
  std::vector<std::string> names;
  NameTriple position{0, 1, 2};
};

/// What header lines and comments say about `columns` columns; nothing where they say nothing. Throws
/// ColumnsUnknown where a header names other things than a position.
std::optional<ColumnNames> find_column_names(const std::vector<std::string_view>& lines, std::size_t columns,
                                             const std::string& file);

}  // namespace rbvh
