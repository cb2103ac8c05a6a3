// Casting rays.
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "python/arrays.h"
#include "python/asset.h"
#include "rbvh/frame.h"
#include "rbvh/ray_rows.h"
#include "rbvh/scan.h"
#include "rbvh/scene.h"

namespace rbvh_python {
namespace {

void warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 2) != 0) throw py::error_already_set();
}

rbvh::RayRows rows_of(const FloatArray& rays, const PyAsset& self) {
  rbvh::RayRows rows;
  rows.data = rays.data();
  rows.is_double = rays.is_double;
  rows.columns = static_cast<std::size_t>(rays.array.shape(rays.array.ndim() - 1));
  rows.rows = rays.rows();
  rows.shift = rbvh::shift(self.asset);
  return rows;
}

/// Float32 of large coordinates is too coarse for rays at a scan that is shifted for that.
void warn_of_coarse_rays(const rbvh::RayRows& rows, const PyAsset& self) {
  const rbvh::Vec3d s = rows.shift;
  const auto largest = static_cast<float>(std::max({std::abs(s.x), std::abs(s.y), std::abs(s.z)}));
  const float grain = std::nextafter(largest, std::numeric_limits<float>::infinity()) - largest;
  if (!rows.is_double && largest > 0 && grain > 1e-5f * self.asset.bounds.diagonal())
    warn("rays are float32, whose steps are " + std::to_string(grain) +
         " wide at these coordinates; give them as float64");
}

void cast(PyAsset& self, const FloatArray& rays, const std::string& level, rbvh::RayQuery query,
          const std::function<void(std::size_t, std::span<const rbvh::Hit>)>& write) {
  const rbvh::RayRows rows = rows_of(rays, self);
  warn_of_coarse_rays(rows, self);
  std::uint64_t unusable = 0;
  {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(self.mutex);
    unusable = rbvh::cast_rows(self.tracer(level), rows, query, write, check_signals());
  }
  if (unusable > 0)
    warn(std::to_string(unusable) + " rays are not finite or have no direction; taken for misses");
}

/// What a hit's leaf is in Open3D's words: one of which things, and which triangle of it.
struct Numbering {
  std::vector<std::uint32_t> firsts;  ///< of a scene's objects
  std::span<const std::int32_t> ids;  ///< of a scan's triangles or points

  explicit Numbering(const rbvh::Asset& asset) : firsts(rbvh::first_leaves(asset)) {
    if (const rbvh::Scan* scan = asset.scan()) ids = scan->object_ids;
  }
  std::uint32_t geometry(std::uint32_t leaf) const {
    if (leaf < ids.size()) return static_cast<std::uint32_t>(ids[leaf]);
    const auto after = std::upper_bound(firsts.begin(), firsts.end(), leaf);
    return static_cast<std::uint32_t>(after - firsts.begin() - 1);
  }
  std::uint32_t primitive(std::uint32_t leaf, std::uint32_t geometry) const {
    return ids.empty() ? leaf - firsts[geometry] : leaf;
  }
};

py::dict cast_rays(PyAsset& self, const py::object& rays, const std::string& level) {
  const FloatArray from = float_array(rays, "rays", {6, 8});
  const std::vector<py::ssize_t> shape = from.leading();
  auto t = make_array<float>(shape), uvs = make_array<float>(shape, {2}),
       normals = make_array<float>(shape, {3});
  auto geometries = make_array<std::uint32_t>(shape), primitives = make_array<std::uint32_t>(shape);
  float *const to_t = t.mutable_data(), *const to_uv = uvs.mutable_data(),
               *const to_normal = normals.mutable_data();
  std::uint32_t *const to_geometry = geometries.mutable_data(), *const to_primitive =
                                                                    primitives.mutable_data();
  const Numbering numbering(self.asset);
  cast(self, from, level, rbvh::RayQuery::kNearest, [&](std::size_t first, std::span<const rbvh::Hit> hits) {
    for (std::size_t i = first; const rbvh::Hit& hit : hits) {
      const bool found = hit.leaf != RBVH_NO_LEAF;
      const std::uint32_t geometry = found ? numbering.geometry(hit.leaf) : RBVH_NO_LEAF;
      to_t[i] = hit.t;
      to_geometry[i] = geometry;
      to_primitive[i] = found ? numbering.primitive(hit.leaf, geometry) : RBVH_NO_LEAF;
      to_uv[2 * i] = hit.u;
      to_uv[2 * i + 1] = hit.v;
      std::copy_n(hit.normal, 3, to_normal + 3 * i++);
    }
  });
  using namespace py::literals;
  return py::dict("t_hit"_a = t, "geometry_ids"_a = geometries, "primitive_ids"_a = primitives,
                  "primitive_uvs"_a = uvs, "primitive_normals"_a = normals);
}

py::array test_occlusions(PyAsset& self, const py::object& rays, const std::string& level) {
  const FloatArray from = float_array(rays, "rays", {6, 8});
  auto occluded = make_array<bool>(from.leading());
  bool* const to = occluded.mutable_data();
  cast(self, from, level, rbvh::RayQuery::kAny, [&](std::size_t first, std::span<const rbvh::Hit> hits) {
    for (std::size_t i = first; const rbvh::Hit& hit : hits) to[i++] = hit.leaf != RBVH_NO_LEAF;
  });
  return occluded;
}

}  // namespace

void add_rays(AssetClass& asset) {
  asset.def("cast_rays", &cast_rays, py::arg("rays"), py::kw_only(), py::arg("level") = "",
            R"(The nearest hits of rays, with the keys of Open3D's RaycastingScene.

rays: (..., 6) or (..., 8), origin and direction [and tmin, tmax], in the file's own coordinates. float32 in C
order is taken without a copy; float64 keeps its digits where coordinates are large.
level: of a pair, such as "Q2"; the finest by default.

Returns a dict of arrays:
  t_hit (...) float32: in units of the direction's length; inf for a miss
  geometry_ids (...) uint32: the object id of a scan's triangle or point, or which of a scene's instances;
    INVALID_ID for a miss
  primitive_ids (...) uint32: the triangle or point of a scan, the leaf of a pair's level; INVALID_ID for a miss
  primitive_uvs (..., 2) float32: of a triangle (a, b, c): the hit is (1 - u - v) a + u b + v c
  primitive_normals (..., 3) float32: geometric, unit; not turned towards the ray; 0 for a miss)");
  asset.def("test_occlusions", &test_occlusions, py::arg("rays"), py::kw_only(), py::arg("level") = "",
            R"(Whether rays hit anything: faster than cast_rays().

rays and level: as in cast_rays(). Returns (...) bool.)");
}

}  // namespace rbvh_python
