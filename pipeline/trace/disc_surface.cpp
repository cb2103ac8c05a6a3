#include "pipeline/trace/disc_surface.h"

#include <cmath>

#include "pipeline/base/parallel_for.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/scan/linear_color.h"
#include "pipeline/trace/surface.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kLeafSize = 8;
/// How far the surface lies off a disc's plane at most, in its radii: the noise of scanners, or a bend.
constexpr float kThickness = 0.5f;
/// The cosine of two discs' normals that face the same way.
constexpr float kSameWay = 0.5f;
/// The weight that a disc has on its edge too, where it was hit.
constexpr float kLeast = 1e-3f;

/// Where the disc was hit: u and v are along disc_frame() of kernels/bvh/disc.h, in radii.
Vec3f hit_point(const Scan& cloud, const Hit& hit) {
  Vec3f x, y;
  make_frame(array3(hit.normal), x, y);
  return cloud.positions[hit.leaf] + (x * hit.u + y * hit.v) * cloud.radii[hit.leaf];
}

bool contains(const Bounds3f& box, const Vec3f& p) {
  return p.x >= box.lo.x && p.y >= box.lo.y && p.z >= box.lo.z && p.x <= box.hi.x && p.y <= box.hi.y &&
         p.z <= box.hi.z;
}

/// Calls visit(disc) for those whose box the point lies in.
template <class Visit>
void for_discs_at(const Bvh& bvh, const Vec3f& point, Visit visit) {
  std::uint32_t stack[kMaxBvhDepth + 1];
  int top = 0;
  if (!bvh.nodes.empty()) stack[top++] = 0;
  while (top > 0) {
    const BvhNode& node = bvh.nodes[stack[--top]];
    if (!contains(node.bounds, point)) continue;
    if (node.count == 0) {
      stack[top++] = node.first + 1;
      stack[top++] = node.first;
    }
    for (std::uint32_t i = 0; i < node.count; ++i) visit(bvh.order[node.first + i]);
  }
}

struct Blend {
  Vec3f normal{}, color{};
  float weight = 0;
};

Blend blend_at(const Scan& cloud, const DiscSurface& surface, const Hit& hit) {
  const Vec3f point = hit_point(cloud, hit), own = normalized(cloud.normals[hit.leaf]);
  Blend sum;
  const auto add = [&](std::uint32_t i, const Vec3f& normal, float weight) {
    sum.weight += weight;
    sum.normal = sum.normal + normal * weight;
    if (!cloud.colors.empty()) sum.color = sum.color + linear_color(cloud.colors[i]) * weight;
  };
  add(hit.leaf, own, kLeast);
  for_discs_at(surface.bvh, point, [&](std::uint32_t i) {
    const Vec3f d = point - cloud.positions[i], n = normalized(cloud.normals[i]);
    const float above = dot(d, n), radius = cloud.radii[i];
    const float t = (dot(d, d) - above * above) / (radius * radius);
    if (t < 1 && std::abs(above) <= kThickness * radius && dot(n, own) >= kSameWay)
      add(i, n, (1 - t) * (1 - t));
  });
  return sum;
}

}  // namespace

DiscSurface make_disc_surface(const Scan& cloud) {
  // Cubes, as discs count for points above and below them.
  std::vector<Bounds3f> boxes(cloud.positions.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const float radius = cloud.radii[i];
    boxes[i].add(cloud.positions[i] - Vec3f{radius, radius, radius});
    boxes[i].add(cloud.positions[i] + Vec3f{radius, radius, radius});
  }
  return {build_sah_binned_bvh(boxes, {.leaf_size = kLeafSize, .test_width = kLeafSize})};
}

SurfaceSamples sample_surface(const Scan& cloud, const DiscSurface& surface, std::span<const Hit> hits) {
  SurfaceSamples samples;
  samples.normals.resize(hits.size());
  if (!cloud.colors.empty()) samples.colors.resize(hits.size());
  parallel_for(hits.size(), 1 << 12, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (!std::isfinite(hits[i].t)) continue;
      const Blend blend = blend_at(cloud, surface, hits[i]);
      samples.normals[i] = normalized(blend.normal);
      if (!cloud.colors.empty()) samples.colors[i] = blend.color * (1 / blend.weight);
    }
  });
  return samples;
}

}  // namespace rbvh
