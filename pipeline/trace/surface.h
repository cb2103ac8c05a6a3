// What is seen of a surface where rays hit it: smooth normals and colours, for shading.
#pragma once

#include <span>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/texture_sampler.h"
#include "rbvh/scan.h"
#include "rbvh/tracer.h"

namespace rbvh {

/// A scan's smooth normals: its own, or for a mesh without any those of its faces' sides (creases.h), as
/// `build` stores them.
struct ShadingNormals {
  std::vector<Vec3f> normals;
  std::vector<Triangle> corners;  ///< of each triangle, among the normals; none: its vertices
};
ShadingNormals shading_normals(const Scan& scan);

/// Interpolated over the triangle of the mesh that was hit. `normals`: shading_normals(). `textures`: those
/// of the mesh; `spread`: as Tracer::surface()'s. Clouds: disc_surface.h.
SurfaceSamples sample_surface(const Scan& mesh, const ShadingNormals& normals, const TextureSampler& textures,
                              std::span<const Hit> hits, float spread);

/// Bilinear over the texels of the level's normal and colour layers that have a surface; colours of the layer
/// `texture`, where there is one, averaged over what rays cover. The geometric normal
/// where the level has no such layer.
SurfaceSamples sample_surface(const Level& level, std::span<const Hit> hits, float spread = 0);

/// The geometric normals, without colours.
SurfaceSamples geometric_surface(std::span<const Hit> hits);

}  // namespace rbvh
