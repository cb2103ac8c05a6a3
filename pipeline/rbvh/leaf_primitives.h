// The triangles or discs of leaves that hold these in place of a tile.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "rbvh/ray.h"

namespace rbvh {

/// Whether the level's primitives are discs, else triangles.
inline bool holds_discs(const Level& level) { return !level.primitives.radii.empty(); }

/// Of the level's primitives, triangles or discs.
inline std::size_t primitive_count(const Level& level) {
  return holds_discs(level) ? level.primitives.positions.size() : level.primitives.triangles.size();
}

/// For each leaf its first primitive; RBVH_NO_LEAF: it has a tile.
std::vector<std::uint32_t> first_primitives(const Level& level);

/// Its vertices; of a disc three times its centre.
Triangle primitive_corners(const Scan& primitives, std::uint32_t primitive);

/// As kernels take it.
RbvhPrimitive primitive_shape(const Scan& primitives, std::uint32_t primitive);

Bounds3f primitive_bounds(const Scan& primitives, std::uint32_t primitive);

/// Which of the lattice's points along an axis is nearest to `p`, at most 2e9 either way; and where it lies.
std::int32_t lattice_number(const Lattice& lattice, Vec3f p, int axis);
float lattice_place(const Lattice& lattice, std::int32_t number, int axis);

/// The point of the lattice nearest to `p`; of a lattice of step 0, `p`.
Vec3f snapped(const Lattice& lattice, Vec3f p);
/// Of all positions.
std::vector<Vec3f> snapped_positions(const Lattice& lattice, const Scan& primitives);
/// Of a primitive whose vertices are at other places.
Bounds3f placed_bounds(std::span<const Vec3f> places, const Scan& primitives, std::uint32_t primitive);

/// The point of a leaf's primitives nearest to `point`: which of the leaf's it lies on, and the weights there
/// of the three corners (of a disc: the first).
struct PrimitivePoint {
  std::uint32_t primitive = 0;  ///< of the level
  std::array<float, 3> weights{1, 0, 0};
  float distance = 0;  ///< scan units
};
Vec3f point_of(const Scan& primitives, const PrimitivePoint& at);
PrimitivePoint nearest_primitive(const Level& level, std::uint32_t first, std::uint32_t count, Vec3f point);

/// Where a ray hit a leaf whose first primitive is `first`; none on a tile.
std::optional<PrimitivePoint> primitive_at(const Level& level, std::uint32_t first, const Hit& hit);

/// Interpolated there: unit normals, and colours as stored. Zeros where the primitives have none.
Vec3f normal_at(const Scan& primitives, const PrimitivePoint& at);
Vec3f srgb_at(const Scan& primitives, const PrimitivePoint& at);  ///< in [0, 1]

/// Mean side of a texel where the level has `rho` of them on a surface of `area` (scan units squared).
float primitive_texel(double area, float rho);

/// Gives a leaf of primitives its frame: a plane along their mean normal with texels of side `texel`, over
/// which a user's layers are laid out. The same primitives have the same frame, so files need not store it.
void fit_frame(const Scan& primitives, std::uint32_t first, float texel, RbvhLeaf& leaf);

}  // namespace rbvh
