#include "tests/bench/vary_scan.h"

#include <algorithm>
#include <numbers>
#include <random>

#include "pipeline/base/error.h"
#include "pipeline/scan/vertex_normals.h"

namespace rbvh {
namespace {

/// A triangle's side, corner k of it being across.
struct Side {
  std::uint64_t vertices;  ///< both, the smaller in the upper half
  std::uint32_t across;
  std::uint32_t place;  ///< 3 * triangle + k
};

std::vector<Side> sorted_sides(const Scan& mesh) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [lo, hi] = std::minmax(mesh.triangles[t][(k + 1) % 3], mesh.triangles[t][(k + 2) % 3]);
      sides.push_back(
          {std::uint64_t{lo} << 32 | hi, mesh.triangles[t][k], static_cast<std::uint32_t>(3 * t + k)});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.vertices != b.vertices ? a.vertices < b.vertices : a.place < b.place;
  });
  return sides;
}

/// What a vertex's new position is computed from.
struct Ring {
  Vec3d sum, crease_sum;
  std::uint32_t count = 0, creases = 0;
};

Vec3f moved(const Vec3f& at, const Ring& ring) {
  const Vec3d p(at);
  if (ring.creases == 2) return static_cast<Vec3f>(p * 0.75 + ring.crease_sum * 0.125);
  if (ring.creases != 0 || ring.count == 0) return at;
  const double n = ring.count, turn = 0.375 + 0.25 * std::cos(2 * std::numbers::pi / n);
  const double share = (0.625 - turn * turn) / n;
  return static_cast<Vec3f>(p * (1 - n * share) + ring.sum * share);
}

}  // namespace

Scan loop_subdivided(const Scan& mesh) {
  const std::vector<Side> sides = sorted_sides(mesh);
  std::vector<Ring> rings(mesh.positions.size());
  std::vector<std::uint32_t> middles(sides.size());
  std::vector<Vec3f> new_points;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i;
    for (; end < sides.size() && sides[end].vertices == sides[i].vertices; ++end)
      middles[sides[end].place] = static_cast<std::uint32_t>(mesh.positions.size() + new_points.size());
    const auto a = static_cast<std::uint32_t>(sides[i].vertices >> 32),
               b = static_cast<std::uint32_t>(sides[i].vertices);
    const Vec3d pa(mesh.positions[a]), pb(mesh.positions[b]);
    const bool is_crease = end - i != 2;
    for (const auto& [own, other] : {std::pair{a, pb}, std::pair{b, pa}}) {
      Ring& ring = rings[own];
      ring.sum = ring.sum + other;
      ++ring.count;
      if (!is_crease) continue;
      ring.crease_sum = ring.crease_sum + other;
      ++ring.creases;
    }
    Vec3d middle = (pa + pb) * 0.5;
    if (!is_crease)
      middle = (pa + pb) * 0.375 +
               (Vec3d(mesh.positions[sides[i].across]) + Vec3d(mesh.positions[sides[i + 1].across])) * 0.125;
    new_points.push_back(static_cast<Vec3f>(middle));
    i = end;
  }
  Scan fine;
  fine.shift = mesh.shift;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    fine.positions.push_back(moved(mesh.positions[v], rings[v]));
  fine.positions.insert(fine.positions.end(), new_points.begin(), new_points.end());
  fine.triangles.reserve(4 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = mesh.triangles[t];
    const std::uint32_t bc = middles[3 * t], ca = middles[3 * t + 1], ab = middles[3 * t + 2];
    for (const Triangle& part : {Triangle{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}})
      fine.triangles.push_back(part);
  }
  return fine;
}

double mean_edge(const Scan& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      sum += length(Vec3d(mesh.positions[t[(k + 1) % 3]]) - Vec3d(mesh.positions[t[k]]));
  return sum / (3 * static_cast<double>(std::max<std::size_t>(1, mesh.triangles.size())));
}

void add_noise(Scan& scan, double sigma, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gaussian(0, sigma);
  const std::vector<Vec3f> normals = scan.normals.empty() ? vertex_normals(scan) : scan.normals;
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    scan.positions[i] = scan.positions[i] + normals[i] * static_cast<float>(gaussian(random));
}

Scan sample_points(const Scan& mesh, std::size_t count, std::uint64_t seed) {
  std::vector<double> area_before = {0};
  std::vector<Vec3f> normals;
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a(mesh.positions[t[0]]);
    const Vec3d twice = cross(Vec3d(mesh.positions[t[1]]) - a, Vec3d(mesh.positions[t[2]]) - a);
    area_before.push_back(area_before.back() + length(twice) / 2);
    normals.push_back(static_cast<Vec3f>(normalized(twice)));
  }
  RBVH_CHECK(area_before.back() > 0);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  Scan cloud;
  cloud.shift = mesh.shift;
  for (std::size_t i = 0; i < count; ++i) {
    const double at = uniform(random) * area_before.back();
    const auto above = std::upper_bound(area_before.begin() + 1, area_before.end() - 1, at);
    const auto t = static_cast<std::size_t>(above - area_before.begin()) - 1;
    double u = uniform(random), v = uniform(random);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const Vec3d a(mesh.positions[mesh.triangles[t][0]]), b(mesh.positions[mesh.triangles[t][1]]),
        c(mesh.positions[mesh.triangles[t][2]]);
    cloud.positions.push_back(static_cast<Vec3f>(a + (b - a) * u + (c - a) * v));
    cloud.normals.push_back(normals[t]);
  }
  return cloud;
}

}  // namespace rbvh
