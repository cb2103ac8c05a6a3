#include "pipeline/rbvh/leaf_primitives.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/scan/closest_point.h"

namespace rbvh {
namespace {

constexpr float kQuantaPerTexel = 256;
/// A frame's rectangle has no more texels a side: a leaf of large triangles must not be laid out finely.
constexpr float kMostSide = 256;
constexpr std::size_t kGrain = 1 << 14;  // positions

/// The mean of the corners' values by the point's weights.
template <class Value>
Vec3f weighted(const Scan& primitives, const PrimitivePoint& at, Value&& value) {
  const Triangle t = primitive_corners(primitives, at.primitive);
  Vec3f sum{};
  for (std::size_t k = 0; k < 3; ++k)
    if (at.weights[k] != 0) sum = sum + value(t[k]) * at.weights[k];
  return sum;
}

/// Twice the area times the unit normal of a triangle; of a disc as if it were a square around it.
Vec3d area_normal(const Scan& primitives, std::uint32_t i) {
  if (!primitives.radii.empty()) {
    const auto r = static_cast<double>(primitives.radii[i]);
    return static_cast<Vec3d>(primitives.normals[i]) * (r * r);
  }
  const Triangle& t = primitives.triangles[i];
  const auto a = static_cast<Vec3d>(primitives.positions[t[0]]);
  return cross(static_cast<Vec3d>(primitives.positions[t[1]]) - a,
               static_cast<Vec3d>(primitives.positions[t[2]]) - a);
}

float disc_distance(Vec3f p, Vec3f center, float radius, Vec3f normal) {
  const Vec3f d = p - center;
  const float high = dot(d, normal), beside = std::max(0.0f, length(d - normal * high) - radius);
  return std::sqrt(high * high + beside * beside);
}

/// Any unit vector at right angles to w, the same for the same w.
Vec3d any_across(Vec3d w) {
  const Vec3d helper = std::abs(w.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return normalized(cross(helper, w));
}

struct Extent {
  double lo = std::numeric_limits<double>::max(), hi = std::numeric_limits<double>::lowest();

  void add(double at, double radius) {
    lo = std::min(lo, at - radius);
    hi = std::max(hi, at + radius);
  }
};

void put_row(float* row, Vec3d direction, double scale, double offset) {
  row[0] = static_cast<float>(direction.x * scale);
  row[1] = static_cast<float>(direction.y * scale);
  row[2] = static_cast<float>(direction.z * scale);
  row[3] = static_cast<float>(offset);
}

}  // namespace

std::vector<std::uint32_t> first_primitives(const Level& level) {
  std::vector<std::uint32_t> firsts(level.leaves.size(), RBVH_NO_LEAF);
  for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves) firsts[leaf.leaf] = leaf.first;
  return firsts;
}

Triangle primitive_corners(const Scan& primitives, std::uint32_t primitive) {
  if (!primitives.radii.empty()) return {primitive, primitive, primitive};
  return primitives.triangles[primitive];
}

RbvhPrimitive primitive_shape(const Scan& primitives, std::uint32_t primitive) {
  RbvhPrimitive result{};
  if (!primitives.radii.empty()) {
    std::copy_n(&primitives.positions[primitive].x, 3, result.shape);
    result.shape[3] = primitives.radii[primitive];
    std::copy_n(&primitives.normals[primitive].x, 3, result.shape + 4);
    return result;
  }
  const Triangle& t = primitives.triangles[primitive];
  for (std::size_t corner = 0; corner < 3; ++corner)
    std::copy_n(&primitives.positions[t[corner]].x, 3, result.shape + 3 * corner);
  return result;
}

Bounds3f primitive_bounds(const Scan& primitives, std::uint32_t primitive) {
  return placed_bounds(primitives.positions, primitives, primitive);
}

std::int32_t lattice_number(const Lattice& lattice, Vec3f p, int axis) {
  const float number = std::round((p[axis] - lattice.origin[axis]) / lattice.step);
  return static_cast<std::int32_t>(std::clamp(number, -2e9f, 2e9f));
}

float lattice_place(const Lattice& lattice, std::int32_t number, int axis) {
  return lattice.origin[axis] + static_cast<float>(number) * lattice.step;
}

Vec3f snapped(const Lattice& lattice, Vec3f p) {
  if (!(lattice.step > 0)) return p;
  const auto along = [&](int axis) { return lattice_place(lattice, lattice_number(lattice, p, axis), axis); };
  return {along(0), along(1), along(2)};
}

std::vector<Vec3f> snapped_positions(const Lattice& lattice, const Scan& primitives) {
  if (!(lattice.step > 0)) return primitives.positions;
  std::vector<Vec3f> places(primitives.positions.size());
  parallel_for(places.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) places[i] = snapped(lattice, primitives.positions[i]);
  });
  return places;
}

Bounds3f placed_bounds(std::span<const Vec3f> places, const Scan& primitives, std::uint32_t primitive) {
  Bounds3f box;
  if (!primitives.radii.empty()) {
    const float r = unround_radius(round_radius(primitives.radii[primitive]));
    const Vec3f p = places[primitive], radius{r, r, r};
    box.add(p - radius);
    box.add(p + radius);
    return box;
  }
  for (const std::uint32_t i : primitives.triangles[primitive]) box.add(places[i]);
  return box;
}

Vec3f point_of(const Scan& primitives, const PrimitivePoint& at) {
  return weighted(primitives, at, [&](std::uint32_t vertex) { return primitives.positions[vertex]; });
}

std::optional<PrimitivePoint> primitive_at(const Level& level, std::uint32_t first, const Hit& hit) {
  if ((hit.flags & RBVH_HIT_ON_PRIMITIVE) == 0 || first == RBVH_NO_LEAF) return {};
  PrimitivePoint at{.primitive = first + (hit.flags >> RBVH_HIT_PRIMITIVE_SHIFT)};
  if (!holds_discs(level)) at.weights = {1 - hit.u - hit.v, hit.u, hit.v};
  return at;
}

Vec3f normal_at(const Scan& primitives, const PrimitivePoint& at) {
  if (primitives.normals.empty()) return {};
  return normalized(
      weighted(primitives, at, [&](std::uint32_t vertex) { return primitives.normals[vertex]; }));
}

Vec3f srgb_at(const Scan& primitives, const PrimitivePoint& at) {
  if (primitives.colors.empty()) return {};
  return weighted(primitives, at, [&](std::uint32_t vertex) {
    const Color8& c = primitives.colors[vertex];
    return Vec3f{static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])} * (1.0f / 255);
  });
}

PrimitivePoint nearest_primitive(const Level& level, std::uint32_t first, std::uint32_t count, Vec3f point) {
  const Scan& primitives = level.primitives;
  PrimitivePoint best{.primitive = first, .distance = std::numeric_limits<float>::infinity()};
  for (std::uint32_t i = first; i < first + count; ++i) {
    const Triangle t = primitive_corners(primitives, i);
    const Vec3f a = primitives.positions[t[0]];
    PrimitivePoint here{.primitive = i};
    if (holds_discs(level)) {
      here.distance = disc_distance(point, a, primitives.radii[i], primitives.normals[i]);
    } else {
      const Vec3f b = primitives.positions[t[1]], c = primitives.positions[t[2]];
      here.weights = nearest_weights(point, a, b, c);
      here.distance = length(a * here.weights[0] + b * here.weights[1] + c * here.weights[2] - point);
    }
    if (here.distance < best.distance) best = here;
  }
  return best;
}

float primitive_texel(double area, float rho) {
  return static_cast<float>(std::sqrt(std::max(area, 1e-30) / std::max(static_cast<double>(rho), 1.0)));
}

void fit_frame(const Scan& primitives, std::uint32_t first, float texel, RbvhLeaf& leaf) {
  Vec3d w{};
  Bounds3f box;
  for (std::uint32_t i = first; i < first + leaf.primitives; ++i) {
    w = w + area_normal(primitives, i);
    box.add(primitive_bounds(primitives, i));
  }
  const Vec3f e = box.extent();
  const double longest =
      std::max({static_cast<double>(e.x), static_cast<double>(e.y), static_cast<double>(e.z), 1e-15});
  if (!(length(w) > 1e-6 * longest * longest))
    w = e.x <= e.y && e.x <= e.z ? Vec3d{1, 0, 0} : e.y <= e.z ? Vec3d{0, 1, 0} : Vec3d{0, 0, 1};
  w = normalized(w);
  const Vec3d u = any_across(w), v = cross(w, u);
  Extent along[3];
  for (std::uint32_t i = first; i < first + leaf.primitives; ++i)
    for (const std::uint32_t corner : primitive_corners(primitives, i)) {
      const auto p = static_cast<Vec3d>(primitives.positions[corner]);
      const double radius = primitives.radii.empty() ? 0 : static_cast<double>(primitives.radii[corner]);
      along[0].add(dot(u, p), radius);
      along[1].add(dot(v, p), radius);
      along[2].add(dot(w, p), radius);
    }
  const double side = std::max(static_cast<double>(texel), longest / static_cast<double>(kMostSide));
  const auto texels = [&](const Extent& x) {
    return static_cast<std::uint16_t>(std::max(2.0, std::ceil((x.hi - x.lo) / side) + 1));
  };
  leaf.x = leaf.y = 0;
  leaf.width = texels(along[0]);
  leaf.height = texels(along[1]);
  const auto middle = [](const Extent& x) { return 0.5 * (x.lo + x.hi); };
  put_row(leaf.to_tile, u, 1 / side, 0.5 * (leaf.width - 1) - middle(along[0]) / side);
  put_row(leaf.to_tile + 4, v, 1 / side, 0.5 * (leaf.height - 1) - middle(along[1]) / side);
  const double quantum = side / static_cast<double>(kQuantaPerTexel);
  put_row(leaf.to_tile + 8, w, 1 / quantum, 1 - along[2].lo / quantum);
}

}  // namespace rbvh
