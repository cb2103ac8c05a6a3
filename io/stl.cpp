#include "io/stl.h"

#include <cstring>
#include <utility>

#include "io/property_names.h"
#include "io/text_cursor.h"
#include "io/weld.h"

namespace rbvh {
namespace {

// Binary: 80 bytes of header, a count, and per triangle a normal, three corners (float) and two bytes of
// attributes.
constexpr std::size_t kHeader = 84, kTriangle = 50;

std::uint64_t binary_count(std::string_view bytes) {
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof(count));
  return count;
}

bool looks_ascii(std::string_view bytes) {
  static const std::string kNoFile;
  const std::string_view start = without_end_mark(bytes).substr(0, 4096);
  TextCursor words(start, kNoFile);
  if (lower(words.word().substr(0, 6)) != "solid") return false;
  for (const char c : start)
    if (static_cast<unsigned char>(c) < 0x20 && !is_space(c)) return false;
  return true;
}

RawScan read_binary(std::string_view bytes, const std::string& file) {
  if (bytes.size() < kHeader)
    throw Error(ErrorKind::kInput, file, FilePlace{"byte", bytes.size()},
                "cut inside the 84 bytes of STL header");
  const std::uint64_t count = binary_count(bytes);
  const std::uint64_t available = (bytes.size() - kHeader) / kTriangle;
  if (count > available)
    throw Error(ErrorKind::kInput, file, FilePlace{"byte", bytes.size()},
                "the header promises " + std::to_string(count) + " triangles, but there are bytes for " +
                    std::to_string(available) + ": cut, or no STL file");
  const std::size_t left = bytes.size() - kHeader - static_cast<std::size_t>(count) * kTriangle;
  if (left >= kTriangle)
    throw Error(ErrorKind::kInput, file,
                "the header promises " + std::to_string(count) + " triangles, but there are bytes for " +
                    std::to_string(available) + ": the count is wrong");
  RawScan scan;
  if (left > 0)
    scan.notes.push_back(std::to_string(left) + " bytes follow the last triangle and were ignored");
  Welder vertices;
  scan.triangles.reserve(static_cast<std::size_t>(count));
  std::size_t attributes = 0;
  const char* at = bytes.data() + kHeader;
  for (std::uint64_t i = 0; i < count; ++i, at += kTriangle) {
    float corners[9];
    std::memcpy(corners, at + 12, sizeof(corners));
    Triangle triangle;
    for (std::size_t c = 0; c < 3; ++c)
      triangle[c] = vertices.add({corners[3 * c], corners[3 * c + 1], corners[3 * c + 2]});
    scan.triangles.push_back(triangle);
    attributes += at[48] != 0 || at[49] != 0;
  }
  if (attributes > 0)
    scan.notes.push_back("the attribute words of " + std::to_string(attributes) + " triangles are not kept");
  scan.positions = std::move(vertices.positions);
  return scan;
}

/// The next keyword in lower case; "end loop" is "endloop".
std::string keyword(TextCursor& in) {
  std::string word = lower(in.word());
  if (word == "end") word += lower(in.word());
  return word;
}

/// solid NAME { facet normal X Y Z  outer loop  { vertex X Y Z } x 3  endloop  endfacet } endsolid NAME
RawScan read_ascii(std::string_view bytes, const std::string& file) {
  TextCursor in(without_end_mark(bytes), file);
  const auto number = [&] {
    in.skip_spaces();
    const TextCursor start = in;
    const std::string_view word = in.word();
    double value = 0;
    if (word.empty()) in.fail("the file is cut in a vertex");
    if (read_number(word.data(), word.data() + word.size(), value) != word.data() + word.size())
      start.fail(shown(word) + " is not a number");
    return value;
  };
  RawScan scan;
  Welder vertices;
  std::int32_t solid = -1;
  bool inside = false;
  for (;;) {
    in.skip_spaces();
    const TextCursor start = in;
    const std::string word = keyword(in);
    if (word.empty()) {
      if (inside) in.fail("the file is cut: a solid has no 'endsolid'");
      break;
    }
    std::string_view name;
    if (word == "solid" && !inside) {
      ++solid;
      inside = true;
      in.next_line(name);
    } else if (word == "endsolid" && inside) {
      inside = false;
      in.next_line(name);
    } else if (word == "facet" && inside) {
      Triangle triangle{};
      std::size_t corners = 0;
      for (;;) {
        in.skip_spaces();
        const TextCursor at = in;
        const std::string part = keyword(in);
        if (part == "endfacet") break;
        if (part == "vertex") {
          const double x = number(), y = number(), z = number();
          if (corners == 3) at.fail("a facet of more than three corners");
          triangle[corners++] = vertices.add({x, y, z});
        } else if (part == "normal") {
          // Follows from the corners; writers put anything here, so it is not even parsed.
          for (int i = 0; i < 3; ++i) in.word();
        } else if (part.empty()) {
          at.fail("the file is cut in a facet");
        } else if (part != "outer" && part != "loop" && part != "endloop") {
          at.fail(shown(part) + " is not part of a facet");
        }
      }
      if (corners != 3) start.fail("a facet of " + std::to_string(corners) + " corners");
      scan.triangles.push_back(triangle);
      scan.object_ids.push_back(solid);
    } else {
      start.fail(shown(word) + " is not expected here");
    }
  }
  if (solid <= 0) scan.object_ids.clear();
  scan.positions = std::move(vertices.positions);
  return scan;
}

}  // namespace

bool is_stl(std::string_view bytes) {
  if (bytes.size() >= kHeader && bytes.size() == kHeader + binary_count(bytes) * kTriangle) return true;
  return looks_ascii(bytes);
}

RawScan read_stl(std::string_view bytes, const std::string& file) {
  const bool exact = bytes.size() >= kHeader && bytes.size() == kHeader + binary_count(bytes) * kTriangle;
  return !exact && looks_ascii(bytes) ? read_ascii(bytes, file) : read_binary(bytes, file);
}

}  // namespace rbvh
