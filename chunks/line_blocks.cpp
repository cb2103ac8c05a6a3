#include "chunks/line_blocks.h"

#include <algorithm>

#include "io/text_cursor.h"

namespace rbvh {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 22, kLongest = std::size_t{1} << 26;

/// Whether the text before a line's end ends in a backslash.
bool is_continued(std::string_view text) {
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text.ends_with('\\');
}

/// Behind the last line of a text that another may follow; 0: none.
std::size_t end_of_lines(std::string_view text) {
  std::size_t end = text.rfind('\n');
  while (end != std::string_view::npos && is_continued(text.substr(0, end)))
    end = end == 0 ? std::string_view::npos : text.rfind('\n', end - 1);
  return end == std::string_view::npos ? 0 : end + 1;
}

}  // namespace

bool LineBlocks::next(std::string_view& lines) {
  lines_before_ += static_cast<std::uint64_t>(
      std::count(block_.begin(), block_.begin() + static_cast<std::ptrdiff_t>(used_), '\n'));
  block_.erase(0, used_);
  used_ = 0;
  while (!is_at_end_ && (block_.size() < kBlock || end_of_lines(block_) == 0)) {
    if (block_.size() >= kLongest)
      throw Error(ErrorKind::kInput, in_.name(), FilePlace{"line", lines_before_ + 1},
                  "is longer than lines of any scan");
    const std::size_t had = block_.size();
    block_.resize(had + kBlock);
    const std::size_t got = in_.read(std::as_writable_bytes(std::span(block_).subspan(had)));
    block_.resize(had + got);
    is_at_end_ = got < kBlock;
  }
  used_ = is_at_end_ ? block_.size() : end_of_lines(block_);
  lines = std::string_view(block_).substr(0, used_);
  return used_ > 0;
}

}  // namespace rbvh
