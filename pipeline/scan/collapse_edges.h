// Fewer triangles by edge collapse under quadric errors (Garland and Heckbert, "Surface Simplification Using
// Quadric Error Metrics", SIGGRAPH 1997). Libraries' quadrics are sums of floats, whose rounding alone is
// 2e-4 of the extent: more than fine levels' errors and thin parts. And the boundaries of thin parts need
// quadrics of their own.
#pragma once

#include <cstdint>
#include <vector>

#include "rbvh/geometry.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Triangles over places; at one place there may be several vertices, whose attributes differ.
struct CollapseMesh {
  std::vector<Vec3f> places;
  std::vector<std::uint8_t> stays;  ///< each place: 1 must not move
  std::vector<Triangle> triangles;  ///< of places, three different ones
  std::vector<Triangle> vertices;   ///< of each triangle's corners; any numbers
};

/// Draws vertices onto neighbours until each further step would move the surface by more than `error` (scan
/// units, about the rms distance over a vertex's triangles), or a feature edge by as much: edges of one
/// triangle, those where attributes differ, and sharp ones of thin parts. The surface's topology stays:
/// nothing comes apart, closes or vanishes. Deterministic.
void collapse_edges(CollapseMesh& mesh, float error);

}  // namespace rbvh
