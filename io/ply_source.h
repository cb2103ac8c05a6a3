// The values of a PLY file's body, one after the other: from text, or from bytes of either order.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "io/ply_header.h"
#include "io/text_cursor.h"
#include "pipeline/base/error.h"

namespace rbvh::ply {

static_assert(std::endian::native == std::endian::little, "the binary paths assume a little-endian host");

/// What both sources share: where in the elements they are, for messages.
struct Place {
  const Element* element = nullptr;
  std::uint64_t index = 0;

  std::string words() const {
    return element->name + " " + std::to_string(index) + " of " + std::to_string(element->count);
  }
};

class AsciiSource {
 public:
  Place place;
  AsciiSource(std::string_view bytes, std::size_t from, const std::string& file) : in_(bytes, file) {
    in_.at += std::min(from, bytes.size());
  }

  /// A value takes a digit and a space at least; the last one may lack the space.
  std::uint64_t least_bytes(const Property&) const { return 2; }
  std::uint64_t available() const { return in_.remaining() + 1; }

  double number(Type) {
    in_.skip_spaces();
    double value = 0;
    const char* end = read_number(in_.at, in_.end, value);
    if (!end || (end < in_.end && !is_space(*end))) bad_word("a number");
    in_.at = end;
    return value;
  }
  std::int64_t integer(Type) {
    in_.skip_spaces();
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(in_.at, in_.end, value);
    if (error != std::errc() || (end < in_.end && !is_space(*end))) bad_word("an integer");
    in_.at = end;
    return value;
  }
  void skip(Type type, std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) number(type);
  }
  void check_end(const std::vector<Element>&, std::vector<std::string>&) {
    in_.skip_spaces();
    if (!in_.at_end()) in_.fail("there is more data than the header's counts say; one of them is wrong");
  }
  [[noreturn]] void fail(const std::string& what) const { in_.fail(what + " in " + place.words()); }
  [[noreturn]] void fail_here(const std::string& what) const { in_.fail(what); }

 private:
  [[noreturn]] void bad_word(const char* wanted) {
    const TextCursor at = in_;
    const std::string_view word = in_.word();
    if (word.empty()) at.fail("the file is cut in " + place.words() + "; copy it again");
    at.fail(shown(word) + " is not " + wanted + " in " + place.words());
  }
  TextCursor in_;
};

template <bool kSwap>
class BinarySource {
 public:
  Place place;
  BinarySource(std::string_view bytes, std::size_t from, const std::string& file)
      : begin_(bytes.data()), at_(begin_ + from), end_(begin_ + bytes.size()), file_(file) {}

  std::uint64_t least_bytes(const Property& property) const {
    return size_of(property.is_list ? property.count_type : property.type);
  }
  std::uint64_t available() const { return static_cast<std::uint64_t>(end_ - at_); }

  double number(Type type) {
    switch (type) {
      case Type::kInt8:
        return take<std::int8_t>();
      case Type::kUint8:
        return take<std::uint8_t>();
      case Type::kInt16:
        return take<std::int16_t>();
      case Type::kUint16:
        return take<std::uint16_t>();
      case Type::kInt32:
        return take<std::int32_t>();
      case Type::kUint32:
        return take<std::uint32_t>();
      case Type::kFloat32:
        return std::bit_cast<float>(take<std::uint32_t>());
      case Type::kFloat64:
        return std::bit_cast<double>(take<std::uint64_t>());
    }
    return 0;
  }
  /// Of an integer type: none is so wide that a double would round it.
  std::int64_t integer(Type type) {
    RBVH_CHECK(is_integer(type));
    return static_cast<std::int64_t>(number(type));
  }
  void skip(Type type, std::uint64_t count) {
    need(count > available() ? available() + 1 : count * size_of(type));
    at_ += count * size_of(type);
  }
  /// Fewer bytes than one more entry may be padding; more are a wrong count.
  void check_end(const std::vector<Element>& elements, std::vector<std::string>& notes) {
    if (available() == 0) return;
    std::uint64_t entry = 0;
    if (!elements.empty())
      for (const Property& property : elements.back().properties) entry += least_bytes(property);
    const std::string left = std::to_string(available()) + " bytes follow the last element";
    if (available() >= std::max<std::uint64_t>(entry, 4))
      fail_here(left + "; a count in the header is wrong");
    notes.push_back(left + " and were ignored");
  }
  [[noreturn]] void fail(const std::string& what) const { fail_here(what + " in " + place.words()); }
  [[noreturn]] void fail_here(const std::string& what) const {
    throw Error(ErrorKind::kInput, file_, at_byte(at_), what);
  }

 private:
  void need(std::uint64_t bytes) const {
    if (available() < bytes)
      throw Error(ErrorKind::kInput, file_, at_byte(end_),
                  "the file is cut in " + place.words() + "; copy it again");
  }
  FilePlace at_byte(const char* at) const { return {"byte", static_cast<std::uint64_t>(at - begin_)}; }
  template <class T>
  T take() {
    need(sizeof(T));
    unsigned char raw[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i)
      raw[i] = static_cast<unsigned char>(at_[kSwap ? sizeof(T) - 1 - i : i]);
    T value;
    std::memcpy(&value, raw, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  const char *begin_, *at_, *end_;
  const std::string& file_;
};

}  // namespace rbvh::ply
