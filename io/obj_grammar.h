// The grammar of OBJ files: statements, numbers and corners of faces. What becomes of them is its users'
// (io/obj.h for scans, io/polygon_obj.h for base meshes).
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "io/text_cursor.h"

namespace rbvh {

/// Indices as the file has them: from 1, or negative, counted back from the last element so far.
struct ObjCorner {
  static constexpr std::int64_t kMissing = std::numeric_limits<std::int64_t>::min();
  std::int64_t vertex = kMissing, texture = kMissing, normal = kMissing;
};

/// Reads statement after statement. Hostile input is expected: errors are Error(kInput) with the line on
/// which the statement begins.
class ObjGrammar {
 public:
  static constexpr std::int64_t kNone = -1;

  ObjGrammar(std::string_view bytes, const std::string& file)
      : in_(without_end_mark(without_byte_order_mark(bytes, file)), file), line_(in_), words_({}, file) {}

  /// Goes to the next statement; false at the end of the file. A backslash at the end of a line continues the
  /// statement on the next one, but neither a comment nor a name.
  bool next() {
    std::string_view text;
    line_.at = in_.at;
    if (!in_.next_line(text)) return false;
    words_ = TextCursor(text, *in_.file);
    key_ = words_.word();
    if (!cut_continuation(text) || is_comment() || is_name()) return true;
    words_ = TextCursor(join(text), *in_.file);
    key_ = words_.word();
    return true;
  }

  /// The statement's first word; empty for an empty line.
  std::string_view key() const { return key_; }
  bool is_comment() const { return key_.empty() || key_[0] == '#'; }

  /// The rest of the statement.
  std::string_view rest() {
    words_.skip_blanks();
    return {words_.at, words_.remaining()};
  }

  /// Takes numbers, at most `most`; returns how many there were. Anything else is an error.
  int numbers(double* out, int most) {
    int count = 0;
    for (std::string_view word; count < most && take_word(word); ++count)
      if (read_number(word.data(), word.data() + word.size(), out[count]) != word.data() + word.size())
        fail(shown(word) + " is not a number");
    return count;
  }

  /// Takes all of the statement's numbers and keeps the first `most`; returns how many there were.
  int all_numbers(double* out, int most) {
    int count = numbers(out, most);
    if (count == most)
      for (double extra; numbers(&extra, 1) == 1;) ++count;
    return count;
  }

  /// Takes numbers, at most `most`; returns how many there were before the statement's end or another word.
  int leading_numbers(double* out, int most) {
    int count = 0;
    for (std::string_view word; count < most && take_word(word); ++count)
      if (read_number(word.data(), word.data() + word.size(), out[count]) != word.data() + word.size()) break;
    return count;
  }

  /// All of the statement is numbers: as many as wanted, and what follows is a comment.
  bool are_numbers(double* out, int count) {
    std::string_view word;
    return leading_numbers(out, count) == count && !take_word(word);
  }

  /// Takes a corner: v, v/vt, v//vn or v/vt/vn, where vt and vn may be missing. False at the end of the face.
  bool corner(ObjCorner& corner) {
    std::string_view word;
    if (!take_word(word)) return false;
    const char *at = word.data(), *end = at + word.size();
    corner = {};
    corner.vertex = integer(at, end);
    if (corner.vertex == ObjCorner::kMissing || corner.vertex == 0) fail_no_index();
    if (at < end && *at == '/') corner.texture = integer(++at, end);
    if (at < end && *at == '/') corner.normal = integer(++at, end);
    if (at != end) fail("the corner " + shown(word) + " of a face is malformed");
    return true;
  }

  /// One of a corner's indices, from 0, of `count` elements so far; kNone where it is missing. A face may
  /// come before its elements, so whether there are enough is known at the end only.
  std::int64_t index(std::int64_t value, std::size_t count) const {
    if (value == ObjCorner::kMissing) return kNone;
    if (value == 0) fail_no_index();
    if (value > 0) return value - 1;
    if (value < -static_cast<std::int64_t>(count)) fail(out_of_range(value, count, "so far"));
    return value + static_cast<std::int64_t>(count);
  }

  /// What is wrong with an index, as the file has it, for which there are too few elements. The one such
  /// error, wherever it is found: here for indices that count back, by the users at the end for others.
  static std::string out_of_range(std::int64_t index, std::size_t count, const char* what) {
    return "the index " + std::to_string(index) + " is out of range (there are " + std::to_string(count) +
           ' ' + what + ")";
  }

  /// At the end of a file whose last line has no end: the statement may be cut.
  bool is_cut() const { return in_.at_end() && in_.at > in_.begin && !is_line_end(in_.at[-1]); }
  const std::string& file() const { return *in_.file; }

  /// Where the statement begins.
  TextCursor place() const { return line_; }
  [[noreturn]] void fail(const std::string& what) const { line_.fail(what); }

 private:
  [[noreturn]] void fail_no_index() const { fail("a face has a corner that is no index"); }

  /// The next word, up to a comment.
  bool take_word(std::string_view& word) {
    word = words_.word();
    return !word.empty() && word[0] != '#';
  }

  /// kMissing where there is none, 0 where it is too large.
  static std::int64_t integer(const char*& at, const char* end) {
    std::int64_t value = 0;
    const auto [stop, error] = std::from_chars(at, end, value);
    at = stop;
    if (error == std::errc::invalid_argument) return ObjCorner::kMissing;
    return error == std::errc() && value != ObjCorner::kMissing ? value : 0;
  }

  /// Statements whose argument is a name or a path, which may end in a backslash.
  bool is_name() const {
    for (const char* name : {"o", "g", "usemtl", "mtllib", "usemap", "maplib", "call", "csh"})
      if (key_ == name) return true;
    return false;
  }

  /// Cuts the backslash off that ends a line, and blanks behind it; false where there is none.
  static bool cut_continuation(std::string_view& text) {
    std::size_t size = text.size();
    while (size > 0 && is_blank(text[size - 1])) --size;
    if (size == 0 || text[size - 1] != '\\') return false;
    text = text.substr(0, size - 1);
    return true;
  }

  std::string_view join(std::string_view text) {
    joined_.assign(text);
    for (bool more = true; more && in_.next_line(text);) {
      more = cut_continuation(text);
      joined_ += ' ';
      joined_.append(text);
    }
    return joined_;
  }

  TextCursor in_, line_, words_;
  std::string_view key_;
  std::string joined_;
};

}  // namespace rbvh
