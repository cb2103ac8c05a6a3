// Normals of a cloud's points: the plane through each point's neighbourhood, then one consistent side for
// all. Hoppe et al., "Surface Reconstruction from Unorganized Points", SIGGRAPH 1992; the sign over an edge
// is that of Koenig and Gumhold, "Consistent Propagation of Normal Orientations in Point Clouds", VMV 2009.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/scan/neighbors.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// Has a usable direction: finite, not zero.
inline bool is_direction(Vec3f v) { return is_finite(v) && dot(v, v) > 0; }

/// Writes unit normals where `missing` is non-zero; their signs are arbitrary.
void estimate_normals(std::span<const Vec3f> points, const Neighbors& neighbors,
                      std::span<const std::uint8_t> missing, std::span<Vec3f> normals);

/// Orients normals consistently: signs are propagated over a minimum spanning forest of the neighbours'
/// graph, along the edges over which the surface bends least. Each tree then takes the side of its `fixed`
/// normals, which never change; without any it faces outwards, and up where the surface is not closed.
void propagate_orientation(std::span<const Vec3f> points, const Neighbors& neighbors,
                           std::span<const std::uint8_t> fixed, std::span<Vec3f> normals);

/// How well a cloud can have been seen from `viewpoint`, up to 1. For each connected surface, the points in
/// `asked` whose normals face the viewpoint and those that face away are counted, and the larger count less
/// the smaller is summed up, as a share of all points asked. The normals must have been propagated.
double visible_share(std::span<const Vec3f> points, const Neighbors& neighbors,
                     std::span<const Vec3f> normals, std::span<const std::uint8_t> asked, Vec3f viewpoint);

}  // namespace rbvh
