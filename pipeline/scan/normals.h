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

/// Writes unit normals where `missing` is non-zero; their sign means nothing yet.
void estimate_normals(std::span<const Vec3f> points, const Neighbors& neighbors,
                      std::span<const std::uint8_t> missing, std::span<Vec3f> normals);

/// Gives normals that belong together the same side: signs spread over a minimum spanning forest of the
/// neighbours' graph, along the edges over which the surface turns least. A whole tree then takes the side of
/// its `fixed` normals, which never change; without any it faces outwards, and up where it is open.
void propagate_orientation(std::span<const Vec3f> points, const Neighbors& neighbors,
                           std::span<const std::uint8_t> fixed, std::span<Vec3f> normals);

/// How far a cloud can have been seen from `viewpoint`: the share of the points in `asked` whose normals face
/// it or, with all of a connected surface, its back; the larger counts less the smaller. 1: all of them. The
/// normals must have been propagated.
double visible_share(std::span<const Vec3f> points, const Neighbors& neighbors,
                     std::span<const Vec3f> normals, std::span<const std::uint8_t> asked, Vec3f viewpoint);

}  // namespace rbvh
