// A mesh of polygons with texture coordinates a corner: what displacement maps of other programs belong to.
#pragma once

#include <cstdint>
#include <vector>

#include "rbvh/geometry.h"

namespace rbvh {

struct Uv {
  double u = 0, v = 0;
  bool operator==(const Uv&) const = default;
};

struct PolygonCorner {
  static constexpr std::uint32_t kNone = UINT32_MAX;
  std::uint32_t vertex = 0, uv = kNone, normal = kNone;
};

struct PolygonMesh {
  std::vector<Vec3d> positions;
  std::vector<Uv> uvs;
  std::vector<Vec3d> normals;
  std::vector<PolygonCorner> corners;    ///< face after face
  std::vector<std::uint32_t> face_ends;  ///< one past a face's last corner; as many as faces

  std::size_t face_count() const { return face_ends.size(); }
  std::uint32_t face_begin(std::size_t face) const { return face == 0 ? 0 : face_ends[face - 1]; }
};

}  // namespace rbvh
