#include "io/polygon_obj.h"

#include <algorithm>

#include "io/off.h"
#include "io/pcd.h"
#include "io/ply.h"
#include "io/stl.h"
#include "io/text_cursor.h"

namespace rbvh {
namespace {

class PolygonObjReader {
 public:
  PolygonObjReader(std::string_view bytes, const std::string& file) : in_(bytes, file), line_(bytes, file) {}

  PolygonMesh read() {
    std::string_view text;
    for (;;) {
      line_.at = in_.at;
      if (!in_.next_line(text)) break;
      if (!text.empty() && text.back() == '\\') text = join(text);
      statement(text);
    }
    check_range(&PolygonCorner::vertex, mesh_.positions.size(), "vertices");
    check_range(&PolygonCorner::uv, mesh_.uvs.size(), "texture coordinates");
    check_range(&PolygonCorner::normal, mesh_.normals.size(), "normals");
    if (mesh_.face_ends.empty()) {
      throw Error(ErrorKind::kInput, *in_.file, "has no face; a base mesh of quads is wanted");
    }
    return std::move(mesh_);
  }

 private:
  // A backslash continues the statement on the next line.
  std::string_view join(std::string_view text) {
    joined_.assign(text.substr(0, text.size() - 1));
    while (in_.next_line(text)) {
      const bool more = !text.empty() && text.back() == '\\';
      joined_ += ' ';
      joined_.append(text.substr(0, text.size() - (more ? 1 : 0)));
      if (!more) break;
    }
    return joined_;
  }

  void statement(std::string_view text) {
    TextCursor words(text, *in_.file);
    const std::string_view key = words.word();
    if (key == "v") {
      mesh_.positions.push_back(three_numbers(words, "a vertex"));
    } else if (key == "vn") {
      mesh_.normals.push_back(three_numbers(words, "a normal"));
    } else if (key == "vt") {
      double uv[2] = {0, 0};
      if (numbers(words, uv, 2) == 0) line_.fail("a texture coordinate needs two numbers");
      mesh_.uvs.push_back({uv[0], uv[1]});
    } else if (key == "f") {
      face(words);
    }
  }

  int numbers(TextCursor& words, double* out, int most) {
    int count = 0;
    for (std::string_view word; count < most && !(word = words.word()).empty() && word[0] != '#'; ++count)
      if (read_number(word.data(), word.data() + word.size(), out[count]) != word.data() + word.size())
        line_.fail(shown(word) + " is not a number");
    return count;
  }

  Vec3d three_numbers(TextCursor& words, const char* what) {
    double xyz[3];
    if (numbers(words, xyz, 3) != 3) line_.fail(std::string(what) + " needs three numbers");
    return {xyz[0], xyz[1], xyz[2]};
  }

  // Positive, or counted back from the last one there is; may be missing after a slash.
  std::uint32_t index(const char*& at, const char* end, std::size_t count, bool is_optional) {
    std::int64_t value = 0;
    const auto [stop, error] = std::from_chars(at, end, value);
    if (is_optional && stop == at && error == std::errc::invalid_argument) return PolygonCorner::kNone;
    if (error != std::errc() || value == 0) line_.fail("a face has a corner that is no index");
    at = stop;
    if (value < 0) value += static_cast<std::int64_t>(count) + 1;
    if (value < 1 || value > PolygonCorner::kNone - 1) line_.fail("a face has an index that is out of range");
    return static_cast<std::uint32_t>(value - 1);
  }

  void face(TextCursor& words) {
    std::size_t count = 0;
    for (std::string_view word; !(word = words.word()).empty() && word[0] != '#'; ++count) {
      PolygonCorner corner;
      const char* at = word.data();
      const char* end = at + word.size();
      corner.vertex = index(at, end, mesh_.positions.size(), false);
      if (at < end && *at == '/') corner.uv = index(++at, end, mesh_.uvs.size(), true);
      if (at < end && *at == '/') corner.normal = index(++at, end, mesh_.normals.size(), true);
      if (at != end) line_.fail("the corner " + shown(word) + " of a face is malformed");
      mesh_.corners.push_back(corner);
    }
    if (count < 3) line_.fail("a face has fewer than three corners; is the file cut?");
    if (mesh_.corners.size() >= PolygonCorner::kNone) line_.fail("there are too many corners");
    mesh_.face_ends.push_back(static_cast<std::uint32_t>(mesh_.corners.size()));
  }

  // A face may come before what it names, so this is known at the end only.
  void check_range(std::uint32_t PolygonCorner::*index, std::size_t count, const char* what) {
    for (std::size_t face = 0; face < mesh_.face_count(); ++face)
      for (std::uint32_t c = mesh_.face_begin(face); c < mesh_.face_ends[face]; ++c)
        if (const std::uint32_t i = mesh_.corners[c].*index; i != PolygonCorner::kNone && i >= count)
          throw Error(ErrorKind::kInput, *in_.file,
                      "face " + std::to_string(face + 1) + ": the index " + std::to_string(i + 1) +
                          " is out of range (there are " + std::to_string(count) + " " + what + ")");
  }

  TextCursor in_, line_;
  std::string joined_;
  PolygonMesh mesh_;
};

}  // namespace

PolygonMesh read_polygon_obj(std::string_view bytes, const std::string& file) {
  if (is_ply(bytes) || is_pcd(bytes) || is_stl(bytes) || is_off(bytes))
    throw Error(ErrorKind::kInput, file,
                "is no OBJ; the base of a displacement map must be an OBJ of quads with texture coordinates");
  return PolygonObjReader(bytes, file).read();
}

}  // namespace rbvh
