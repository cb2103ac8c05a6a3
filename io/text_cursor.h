// Reading numbers and words out of text in memory, whatever the process's locale is. Errors name the line.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "pipeline/base/error.h"

namespace rbvh {

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
inline bool is_line_end(char c) { return c == '\n' || c == '\r'; }
inline bool is_space(char c) { return is_blank(c) || is_line_end(c); }

/// Parses a number at `first`; returns the end of it, or nullptr when there is none. Takes a leading '+',
/// "nan", "inf" and the "1.#QNAN" of old Windows programs; too large becomes infinite, too small zero.
inline const char* read_number(const char* first, const char* last, double& value) {
  const bool plus = first < last && *first == '+';
  if (plus && last - first > 1 && first[1] == '-') return nullptr;
  auto [end, error] = std::from_chars(first + (plus ? 1 : 0), last, value);
  if (error == std::errc::invalid_argument) return nullptr;
  if (error == std::errc::result_out_of_range) {
    bool tiny = false;
    for (const char* c = first; c + 1 < end; ++c) tiny |= (*c == 'e' || *c == 'E') && c[1] == '-';
    const double huge = std::numeric_limits<double>::infinity();
    value = tiny ? 0.0 : *first == '-' ? -huge : huge;
  }
  if (end < last && *end == '#') {
    while (end < last && !is_space(*end) && *end != ',' && *end != ';') ++end;
    value = std::numeric_limits<double>::quiet_NaN();
  }
  return end;
}

/// Without the spaces at both ends.
inline std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  return text;
}

/// A text without the Ctrl-Z or zeros that old programs end it with.
inline std::string_view without_end_mark(std::string_view text) {
  std::size_t size = text.size(), end = size;
  while (size > 0 && (is_space(text[size - 1]) || text[size - 1] == '\x1a' || text[size - 1] == '\0'))
    if (--size; !is_space(text[size])) end = size;
  return text.substr(0, end);
}

/// Each second byte of the first eight is zero, and no other.
inline bool is_wide(std::string_view text, std::size_t zeros) {
  if (text.size() < 8) return false;
  for (std::size_t i = 0; i < 8; ++i)
    if ((text[i] == '\0') != (i % 2 == zeros)) return false;
  return true;
}

/// A text without a byte-order mark. Throws Error(kInput) for UTF-16.
inline std::string_view without_byte_order_mark(std::string_view text, const std::string& file) {
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff") || is_wide(text, 0) || is_wide(text, 1))
    throw Error(ErrorKind::kInput, file, "is text in UTF-16; save it as UTF-8");
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  return text;
}

/// A place in a text. All functions stay inside [begin, end).
struct TextCursor {
  const char* begin;
  const char* at;
  const char* end;
  const std::string* file;

  TextCursor(std::string_view text, const std::string& file_name)
      : begin(text.data()), at(begin), end(begin + text.size()), file(&file_name) {}

  std::size_t remaining() const { return static_cast<std::size_t>(end - at); }
  std::size_t byte() const { return static_cast<std::size_t>(at - begin); }

  /// Counted only when an error needs it. "\r\n", "\n" and "\r" each end a line.
  std::size_t line() const {
    std::size_t lines = 1;
    for (const char* c = begin; c < at; ++c)
      lines += *c == '\n' || (*c == '\r' && !(c + 1 < end && c[1] == '\n'));
    return lines;
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ErrorKind::kInput, *file, FilePlace{"line", line()}, what);
  }

  bool at_end() const { return at >= end; }
  void skip_blanks() {
    while (at < end && is_blank(*at)) ++at;
  }
  void skip_spaces() {
    while (at < end && is_space(*at)) ++at;
  }
  /// Takes the next line without its end; false when there is none.
  bool next_line(std::string_view& text) {
    if (at_end()) return false;
    const char* first = at;
    while (at < end && !is_line_end(*at)) ++at;
    text = {first, static_cast<std::size_t>(at - first)};
    if (at < end && *at++ == '\r' && at < end && *at == '\n') ++at;
    return true;
  }
  /// Takes the next word of the text (of a line, when the cursor is over a line); empty at the end.
  std::string_view word() {
    skip_spaces();
    const char* first = at;
    while (at < end && !is_space(*at)) ++at;
    return {first, static_cast<std::size_t>(at - first)};
  }
};

/// A word as it can be shown in a one-line message: cut to a handful of characters, none of them a control
/// character.
inline std::string shown(std::string_view word, std::size_t most = 24) {
  std::string text(word.substr(0, most));
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7f) c = '?';
  return "'" + text + (word.size() > most ? "...'" : "'");
}

}  // namespace rbvh
