#include "pipeline/trace/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/srgb.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/rbvh/height_normals.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/rbvh/texture_layer.h"
#include "pipeline/scan/creases.h"
#include "pipeline/scan/linear_color.h"

namespace rbvh {
namespace {

bool is_hit(const Hit& hit) { return std::isfinite(hit.t); }

Vec3f unpack_color(std::uint16_t packed) {
  const Vec3f c = unpack_srgb(packed);
  return {srgb_to_linear(c.x), srgb_to_linear(c.y), srgb_to_linear(c.z)};
}

Vec3f linear_color_at(const Scan& primitives, const PrimitivePoint& at) {
  if (primitives.colors.empty()) return kClay;
  const Triangle corners = primitive_corners(primitives, at.primitive);
  Vec3f color{};
  for (std::size_t k = 0; k < 3; ++k)
    color = color + linear_color(primitives.colors[corners[k]]) * at.weights[k];
  return color;
}

// A hit's four texels in the atlas and how much each counts; those without a surface count nothing.
struct Footprint {
  int x = 0, y = 0;  // of the first in its tile
  std::array<std::size_t, 4> texels{};
  std::array<float, 4> weights{};
};
Footprint footprint(const Level& level, const std::vector<std::uint16_t>& heights, const Hit& hit) {
  const RbvhLeaf& leaf = level.leaves[hit.leaf];
  const float u = std::clamp(hit.u, 0.f, 1.f) * static_cast<float>(leaf.width - 1);
  const float v = std::clamp(hit.v, 0.f, 1.f) * static_cast<float>(leaf.height - 1);
  const std::size_t x = std::min(static_cast<std::size_t>(u), std::size_t{leaf.width} - 2);
  const std::size_t y = std::min(static_cast<std::size_t>(v), std::size_t{leaf.height} - 2);
  const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
  Footprint f;
  f.x = static_cast<int>(x);
  f.y = static_cast<int>(y);
  f.weights = {(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv};
  for (std::size_t i = 0; i < 4; ++i) {
    f.texels[i] = (leaf.y + y + i / 2) * level.atlas_width + leaf.x + x + i % 2;
    if (heights[f.texels[i]] == 0) f.weights[i] = 0;
  }
  return f;
}

}  // namespace

ShadingNormals shading_normals(const Scan& scan) {
  if (!scan.normals.empty()) return {scan.normals, {}};
  CreasedMesh creased = split_creases(scan);
  std::vector<Vec3f> normals = vertex_normals(scan, creased);
  return {std::move(normals),
          creased.copies.empty() ? std::vector<Triangle>() : std::move(creased.triangles)};
}

SurfaceSamples sample_surface(const Scan& mesh, const ShadingNormals& normals, const TextureSampler& textures,
                              std::span<const Hit> hits, float spread) {
  SurfaceSamples samples;
  samples.normals.resize(hits.size());
  const bool has_colors = !mesh.colors.empty();
  if (has_colors || !mesh.textures.empty()) samples.colors.resize(hits.size(), kClay);
  parallel_for(hits.size(), 1 << 14, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Hit& hit = hits[i];
      if (!is_hit(hit)) continue;
      const Triangle& corners = mesh.triangles[hit.leaf];
      const Triangle& sides = normals.corners.empty() ? corners : normals.corners[hit.leaf];
      const std::array<float, 3> weights = {1 - hit.u - hit.v, hit.u, hit.v};
      Vec3f normal{}, color{};
      for (std::size_t k = 0; k < 3; ++k) {
        normal = normal + normals.normals[sides[k]] * weights[k];
        if (has_colors) color = color + linear_color(mesh.colors[corners[k]]) * weights[k];
      }
      normal = normalized(normal);
      samples.normals[i] = dot(normal, normal) > 0.5f ? normal : array3(hit.normal);
      if (has_colors) samples.colors[i] = color;
      if (const auto shown = textures.color(hit.leaf, weights, spread * hit.t)) samples.colors[i] = *shown;
    }
  });
  return samples;
}

SurfaceSamples sample_surface(const Level& level, std::span<const Hit> hits, float spread) {
  const Layer *heights = find_layer(level, "height"), *normals = find_layer(level, "normal"),
              *colors = find_layer(level, "color"), *texture = texture_layer(level);
  RBVH_CHECK(heights != nullptr);
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  SurfaceSamples samples;
  samples.normals.resize(hits.size());
  if (colors || texture) samples.colors.resize(hits.size(), kClay);
  parallel_for(hits.size(), 1 << 14, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Hit& hit = hits[i];
      if (!is_hit(hit)) continue;
      if (const auto primitive = primitive_at(level, firsts[hit.leaf], hit)) {
        const Vec3f normal = normal_at(level.primitives, *primitive);
        samples.normals[i] = dot(normal, normal) > 0.5f ? normal : array3(hit.normal);
        if (colors) samples.colors[i] = linear_color_at(level.primitives, *primitive);
        if (!texture) continue;
        const Vec3f at = to_tile(level.leaves[hit.leaf], point_of(level.primitives, *primitive));
        if (const auto shown = texture_color(level, *texture, hit.leaf, at.x, at.y, spread * hit.t))
          samples.colors[i] = *shown;
        continue;
      }
      const Footprint f = footprint(level, heights->texels, hit);
      Vec3f normal{}, color{};
      float weight = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        if (!(f.weights[k] > 0)) continue;
        weight += f.weights[k];
        const Vec3f own = normals
                              ? unpack_normal(normals->texels[f.texels[k]])
                              : height_normal(level, level.leaves[hit.leaf], f.x + static_cast<int>(k % 2),
                                              f.y + static_cast<int>(k / 2));
        normal = normal + own * f.weights[k];
        if (colors) color = color + unpack_color(colors->texels[f.texels[k]]) * f.weights[k];
      }
      normal = normalized(normal);
      samples.normals[i] = dot(normal, normal) > 0.5f ? normal : array3(hit.normal);
      if (colors) samples.colors[i] = weight > 0 ? color * (1 / weight) : kClay;
      if (!texture) continue;
      const RbvhLeaf& leaf = level.leaves[hit.leaf];
      const float u = std::clamp(hit.u, 0.f, 1.f) * static_cast<float>(leaf.width - 1),
                  v = std::clamp(hit.v, 0.f, 1.f) * static_cast<float>(leaf.height - 1);
      if (const auto shown = texture_color(level, *texture, hit.leaf, u, v, spread * hit.t))
        samples.colors[i] = *shown;
    }
  });
  return samples;
}

SurfaceSamples geometric_surface(std::span<const Hit> hits) {
  SurfaceSamples samples;
  samples.normals.resize(hits.size());
  for (std::size_t i = 0; i < hits.size(); ++i)
    if (hits[i].leaf != RBVH_NO_LEAF) samples.normals[i] = array3(hits[i].normal);
  return samples;
}

}  // namespace rbvh
