#include "io/text_columns.h"

#include <algorithm>

#include "io/text_cursor.h"

namespace rbvh {
namespace {

bool is_number(std::string_view cell) {
  double value = 0;
  return read_cell(cell, ' ', value);
}

/// "0,5 1,25 3": words of at most one comma each, none of them at an end.
bool has_decimal_commas(std::string_view line) {
  std::size_t words = 0;
  Cells cells(' ');
  for (const std::string_view word : cells.cut(line)) {
    ++words;
    if (word.front() == ',' || word.back() == ',' || std::count(word.begin(), word.end(), ',') > 1)
      return false;
  }
  return words >= 3;
}

/// Tabs separate where no cell between them is empty or holds several numbers.
bool has_tabs(std::string_view line) {
  if (line.find('\t') == std::string_view::npos) return false;
  Cells tabs('\t'), blanks(' ');
  const auto& cells = tabs.cut(line);
  if (cells.size() < 3) return false;
  for (const std::string_view cell : cells) {
    if (cell.empty()) return false;
    const auto& words = blanks.cut(cell);
    if (words.size() > 1 && std::all_of(words.begin(), words.end(), is_number)) return false;
  }
  return true;
}

[[noreturn]] void refuse(const std::string& file, std::string_view header, const char* because) {
  std::string text(header.substr(0, 100));
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  throw ColumnsUnknown(ErrorKind::kInput, file, "the header '" + text + "' " + because);
}

std::vector<std::string> cut_names(std::string_view line) {
  Cells cells(separator_of(line));
  const auto& names = cells.cut(line);
  return {names.begin(), names.end()};
}

}  // namespace

const std::vector<std::string_view>& Cells::cut(std::string_view line) {
  cells_.clear();
  const char* at = line.data();
  const char* end = at + line.size();
  for (;;) {
    while (at < end && is_blank(*at) && *at != separator_) ++at;
    if (separator_ == ' ')
      while (at < end && is_blank(*at)) ++at;
    if (separator_ == ' ' && at == end) return cells_;
    const char* first = at;
    while (at < end && (separator_ == ' ' ? !is_blank(*at) : *at != separator_)) ++at;
    const char* last = at;
    while (last > first && is_blank(last[-1])) --last;
    if (last - first >= 2 && *first == '"' && last[-1] == '"') ++first, --last;
    const bool is_last = at == end;
    // A separator at the end of a line is no further cell.
    if (!(is_last && first == last)) cells_.push_back({first, static_cast<std::size_t>(last - first)});
    if (is_last) return cells_;
    ++at;
  }
}

char separator_of(std::string_view line) {
  if (line.find(';') != std::string_view::npos) return ';';
  if (has_tabs(line)) return '\t';
  const bool commas = line.find(',') != std::string_view::npos;
  return commas && !has_decimal_commas(line) ? ',' : ' ';
}

bool read_cell(std::string_view cell, char separator, double& value) {
  if (cell.empty()) return false;
  const auto comma = separator == ',' ? std::string_view::npos : cell.find(',');
  if (comma == std::string_view::npos)
    return read_number(cell.data(), cell.data() + cell.size(), value) == cell.data() + cell.size();
  std::string replaced(cell);
  replaced[comma] = '.';
  return read_number(replaced.data(), replaced.data() + replaced.size(), value) ==
         replaced.data() + replaced.size();
}

std::optional<std::string_view> comment_text(std::string_view line) {
  const std::size_t start = line.find_first_not_of(" \t");
  if (start == std::string_view::npos) return std::nullopt;
  line.remove_prefix(start);
  if (line[0] != '#' && line.substr(0, 2) != "//") return std::nullopt;
  line.remove_prefix(std::min(line.find_first_not_of("#/ \t"), line.size()));
  return line;
}

std::optional<ColumnNames> find_column_names(const std::vector<std::string_view>& lines, std::size_t columns,
                                             const std::string& file) {
  // The last line that names a position counts: what stands before it is a title.
  for (auto line = lines.rbegin(); line != lines.rend(); ++line) {
    const auto text = comment_text(*line);
    ColumnNames found{cut_names(text.value_or(*line)), {}};
    // A comment or title may begin with a word before the names, and names may be fewer than the columns.
    const bool fits = found.names.size() == columns || (!text && found.names.size() < columns);
    if (!fits) continue;
    const auto position = find_position(found.names);
    if (!position) continue;
    found.names.resize(columns);
    found.position = *position;
    return found;
  }
  for (auto line = lines.rbegin(); line != lines.rend(); ++line) {
    const auto text = comment_text(*line);
    const std::vector<std::string> names = cut_names(text.value_or(*line));
    if (has_degrees(names))
      refuse(
          file, text.value_or(*line),
          "names degrees, and coordinates are lengths: project them, or say at ingest which columns to take");
    if (names.size() < 3 || std::all_of(names.begin(), names.end(), is_number)) continue;
    const bool of_columns = names.size() == columns && line == lines.rbegin();
    // Words with blanks between may be a title, and comments may be anything.
    const bool is_list = !text && separator_of(*line) != ' ';
    if (of_columns && (is_list || std::all_of(names.begin(), names.end(), is_known_name)))
      refuse(file, text.value_or(*line), "names no x, y and z: say at ingest which columns they are");
  }
  return std::nullopt;
}

}  // namespace rbvh
