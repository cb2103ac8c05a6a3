// What is seen of a surface where rays hit it: smooth normals and colours, for shading.
#pragma once

#include <span>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// What surfaces without colours are made of, in linear light.
inline constexpr Vec3f kClay{0.50f, 0.455f, 0.41f};

/// The surface at each hit, in their order. Colours are linear light; empty: kClay.
struct SurfaceSamples {
  std::vector<Vec3f> normals;  ///< smooth, unit, unflipped; zero where nothing is hit
  std::vector<Vec3f> colors;
};

/// A scan's smooth normals: its own, or for a mesh without any those of vertex_normals() (as `build` stores
/// them).
std::vector<Vec3f> shading_normals(const Scan& scan);

/// Interpolated over the triangle (or constant over the disc) that was hit. `normals` are the scan's
/// shading_normals().
SurfaceSamples sample_surface(const Scan& scan, std::span<const Vec3f> normals, std::span<const Hit> hits);

/// Bilinear over the texels of the level's normal and colour layers that have a surface. The geometric normal
/// where the level has no such layer.
SurfaceSamples sample_surface(const Level& level, std::span<const Hit> hits);

/// The geometric normals, without colours.
SurfaceSamples geometric_surface(std::span<const Hit> hits);

}  // namespace rbvh
