// A text file in blocks of whole lines.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "io/input_file.h"
#include "pipeline/base/error.h"

namespace rbvh {

class LineBlocks {
 public:
  explicit LineBlocks(const std::string& path) : in_(path) {}

  /// Some more lines, with their ends, which stay until the next call; false at the end of the file. No block
  /// ends in a backslash, which continues a line. Throws Error(kInput) for lines longer than any block.
  bool next(std::string_view& lines);
  /// Before those of the last block.
  std::uint64_t lines_before() const { return lines_before_; }

 private:
  InputStream in_;
  std::string block_;
  std::size_t used_ = 0;  ///< bytes of it that were handed out
  std::uint64_t lines_before_ = 0;
  bool is_at_end_ = false;
};

/// Does work that may throw an Error at a line, of a text that begins so many lines into its file.
template <class Work>
auto from_line(std::uint64_t lines, const Work& work) {
  try {
    return work();
  } catch (const Error& error) {
    FilePlace place = error.place();
    if (place.unit == "line") place.number += lines;
    throw Error(error.kind(), error.file(), place, error.message(), error.remedy());
  }
}

}  // namespace rbvh
