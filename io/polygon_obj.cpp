#include "io/polygon_obj.h"

#include <algorithm>

#include "io/obj_grammar.h"
#include "io/off.h"
#include "io/pcd.h"
#include "io/ply.h"
#include "io/stl.h"

namespace rbvh {
namespace {

class PolygonObjReader {
 public:
  PolygonObjReader(std::string_view bytes, const std::string& file) : in_(bytes, file) {}

  PolygonMesh read() {
    while (in_.next()) statement(in_.key());
    check_range(&PolygonCorner::vertex, mesh_.positions.size(), "vertices");
    check_range(&PolygonCorner::uv, mesh_.uvs.size(), "texture coordinates");
    check_range(&PolygonCorner::normal, mesh_.normals.size(), "normals");
    if (mesh_.face_ends.empty())
      throw Error(ErrorKind::kInput, in_.file(), "has no face; a base mesh of quads is wanted");
    return std::move(mesh_);
  }

 private:
  /// Everything else is another program's, and ignored.
  void statement(std::string_view key) {
    if (key == "v") {
      mesh_.positions.push_back(three_numbers("a vertex"));
    } else if (key == "vn") {
      mesh_.normals.push_back(three_numbers("a normal"));
    } else if (key == "vt") {
      double uv[2] = {0, 0};
      if (in_.numbers(uv, 2) == 0) in_.fail("a texture coordinate needs two numbers");
      mesh_.uvs.push_back({uv[0], uv[1]});
    } else if (key == "f") {
      face();
    }
  }

  Vec3d three_numbers(const char* what) {
    double xyz[3];
    if (in_.numbers(xyz, 3) != 3) in_.fail(std::string(what) + " needs three numbers");
    return {xyz[0], xyz[1], xyz[2]};
  }

  std::uint32_t index(std::int64_t value, std::size_t count) const {
    const std::int64_t index = in_.index(value, count);
    if (index == ObjGrammar::kNone) return PolygonCorner::kNone;
    if (index >= PolygonCorner::kNone - 1) in_.fail("a face has an index that is out of range");
    return static_cast<std::uint32_t>(index);
  }

  void face() {
    std::size_t count = 0;
    for (ObjCorner corner; in_.corner(corner); ++count)
      mesh_.corners.push_back({.vertex = index(corner.vertex, mesh_.positions.size()),
                               .uv = index(corner.texture, mesh_.uvs.size()),
                               .normal = index(corner.normal, mesh_.normals.size())});
    if (count < 3) in_.fail("a face has fewer than three corners; is the file cut?");
    if (mesh_.corners.size() >= PolygonCorner::kNone) in_.fail("there are too many corners");
    mesh_.face_ends.push_back(static_cast<std::uint32_t>(mesh_.corners.size()));
  }

  // A face may come before what it names, so this is known at the end only.
  void check_range(std::uint32_t PolygonCorner::*index, std::size_t count, const char* what) {
    for (std::size_t face = 0; face < mesh_.face_count(); ++face)
      for (std::uint32_t c = mesh_.face_begin(face); c < mesh_.face_ends[face]; ++c)
        if (const std::uint32_t i = mesh_.corners[c].*index; i != PolygonCorner::kNone && i >= count)
          throw Error(ErrorKind::kInput, in_.file(),
                      "face " + std::to_string(face + 1) + ": " +
                          ObjGrammar::out_of_range(std::int64_t{i} + 1, count, what));
  }

  ObjGrammar in_;
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
