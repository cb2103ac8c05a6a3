// Decimate, pair triangles to quads, trace each texel back through the decimation to its point on the scan.
#include "pipeline/proxy/bake.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <mutex>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/decimate.h"
#include "pipeline/proxy/join_edges.h"
#include "pipeline/proxy/pack_map.h"
#include "pipeline/proxy/pair_triangles.h"
#include "pipeline/proxy/patch_point.h"

namespace rbvh {
namespace {

// No single point may be off by more than this times the RMS that is allowed.
constexpr double kWorstPoint = 8;
// Points that only move along the surface matter less (squared): it is another parametrisation of the same.
constexpr double kAlongWeight = 0.04;
constexpr double kQuantaPerDetail = 32;
constexpr std::uint32_t kFirstSide = 9;  ///< of the grids that are tried
constexpr int kMostTries = 6;            ///< at a base of few enough quads

struct Quads {
  const Manifold& scan;
  const BaseMesh& base;
  const SelfMap& map;
  std::vector<TrianglePair> pairs;

  Vec3f on_scan(std::uint32_t triangle, std::array<double, 3> weights, std::uint32_t* hit) const {
    const FacePoint p = map.to_original({base.versions[triangle], weights});
    if (hit != nullptr) *hit = p.version;
    const Triangle& t = scan.triangles[p.version];
    Vec3d sum{};
    for (std::size_t k = 0; k < 3; ++k) sum = sum + Vec3d(scan.positions[t[k]]) * p.weights[k];
    return Vec3f(sum);
  }

  // The base's point under (s, t) of a quad, linear in each of its triangles, taken to the scan. The side
  // that the two share is the diagonal from (0, 0) to (1, 1), along which texel quads are cut, too.
  // `hit` gets the scan's triangle.
  Vec3f at(std::size_t quad, double s, double t, std::uint32_t* hit = nullptr) const {
    const TrianglePair& pair = pairs[quad];
    std::array<double, 3> weights{};
    const bool is_alone = pair.second == TrianglePair::kNone;
    const bool is_first = is_alone || t >= s;
    const std::size_t side = is_first ? pair.first_side : pair.second_side;
    double &from = weights[side], &to = weights[(side + 1) % 3], &opposite = weights[(side + 2) % 3];
    if (is_alone) {
      from = (1 - s) * (1 - t) + s * (1 - t) / 2;
      to = s * t + s * (1 - t) / 2;
      opposite = (1 - s) * t;
    } else if (is_first) {
      from = 1 - t;
      to = s;
      opposite = t - s;
    } else {
      from = t;
      to = 1 - s;
      opposite = s - t;
    }
    return on_scan(is_first ? pair.first : pair.second, weights, hit);
  }
};

std::vector<TrianglePair> make_pairs(Decimation& decimation, const std::string& file,
                                     const BakeConfig& config, double diagonal, BaseMesh& base,
                                     BakeReport& counts, const Progress& progress) {
  const double error =
      config.max_error > 0 ? config.max_error * diagonal : std::numeric_limits<double>::max();
  std::vector<TrianglePair> pairs;
  std::uint64_t target = 2 * config.max_patches;
  for (int tries = 0;; ++tries) {
    Stopwatch watch;
    decimation.run(target, error, progress);
    counts.decimate_seconds += watch.lap();
    base = decimation.base();
    report(progress, "pairing triangles", 0);
    pairs = pair_triangles(base, counts.alone_triangles);
    counts.pair_seconds += watch.lap();
    if (config.max_patches == 0 || pairs.size() <= config.max_patches) return pairs;
    // Triangles that stand alone cost a patch each.
    const std::uint64_t excess = 2 * (pairs.size() - config.max_patches);
    const bool is_stuck = decimation.triangle_count() > target;
    if (is_stuck || tries == kMostTries || excess >= target)
      throw Error(ErrorKind::kBudget, file,
                  "cannot have fewer than " + std::to_string(pairs.size()) + " patches, as it has " +
                      std::to_string(counts.mesh.components) + " parts" +
                      (config.max_error > 0 ? " and an error bound" : ""),
                  Remedy::kPatchCount);
    target -= excess;
  }
}

// The base as it goes to the proxy: a quad (p, s, q, r) for every pair.
void make_base(const Quads& quads, Proxy& proxy) {
  proxy.positions = quads.base.positions;
  for (std::size_t i = 0; i < quads.pairs.size(); ++i) {
    const TrianglePair& pair = quads.pairs[i];
    const Triangle& a = quads.base.triangles[pair.first];
    const std::size_t side = pair.first_side;
    std::uint32_t s = 0;
    if (pair.second != TrianglePair::kNone) {
      s = quads.base.triangles[pair.second][(pair.second_side + 2u) % 3];
    } else {
      s = static_cast<std::uint32_t>(proxy.positions.size());
      proxy.positions.push_back(quads.at(i, 1, 0));
    }
    proxy.quads.push_back({a[side], s, a[(side + 1) % 3], a[(side + 2) % 3]});
  }
}

// Points of a quad on the scan, side x side, row by row.
struct Grid {
  std::uint32_t side = 0;
  std::vector<Vec3f> points;
  const Vec3f& at(std::uint32_t i, std::uint32_t j) const { return points[std::size_t{j} * side + i]; }
};

Grid sample(const Quads& quads, std::size_t quad, std::uint32_t side, const Grid& coarser) {
  Grid grid{side, std::vector<Vec3f>(std::size_t{side} * side)};
  const double step = 1.0 / (side - 1);
  for (std::uint32_t j = 0; j < side; ++j)
    for (std::uint32_t i = 0; i < side; ++i)
      grid.points[std::size_t{j} * side + i] = coarser.side > 0 && i % 2 == 0 && j % 2 == 0
                                                   ? coarser.at(i / 2, j / 2)
                                                   : quads.at(quad, i * step, j * step);
  return grid;
}

Grid every_second(const Grid& fine) {
  Grid grid{(fine.side + 1) / 2, {}};
  for (std::uint32_t j = 0; j < fine.side; j += 2)
    for (std::uint32_t i = 0; i < fine.side; i += 2) grid.points.push_back(fine.at(i, j));
  return grid;
}

// How far the fine grid's points lie from the surface of every `stride`-th of them, as a multiple of
// `allowed` (RMS, or the worst point's share of kWorstPoint). Cells are two triangles.
double error_without(const Grid& fine, std::uint32_t stride, double allowed) {
  double sum = 0, worst = 0;
  for (std::uint32_t j = 0; j + 1 < fine.side; j += stride)
    for (std::uint32_t i = 0; i + 1 < fine.side; i += stride) {
      const Vec3d a(fine.at(i, j)), b(fine.at(i + stride, j)), c(fine.at(i + stride, j + stride)),
          d(fine.at(i, j + stride));
      const Vec3d normal = normalized(cross(c - a, d - b));
      for (std::uint32_t y = 0; y < stride; ++y)
        for (std::uint32_t x = 0; x < stride; ++x) {
          if (x == 0 && y == 0) continue;
          const double s = static_cast<double>(x) / stride, t = static_cast<double>(y) / stride;
          const Vec3d flat = s >= t ? a + (b - a) * s + (c - b) * t : a + (c - d) * s + (d - a) * t;
          const Vec3d off = Vec3d(fine.at(i + x, j + y)) - flat;
          const double along = dot(off, normal), all = dot(off, off);
          const double distance = std::sqrt(along * along + kAlongWeight * (all - along * along));
          sum += distance * distance;
          worst = std::max(worst, distance);
        }
    }
  const double cells = static_cast<double>(fine.side - 1) * (fine.side - 1);
  return std::max(std::sqrt(sum / cells), worst / kWorstPoint) / allowed;
}

// Texels a side beyond which only the scan's own facets would be copied, from about how many triangles the
// patch covers.
std::uint32_t most_side(const Quads& quads, std::size_t quad, const Grid& grid, const BakeConfig& config) {
  const auto triangle_area = [&](std::uint32_t triangle) {
    const Triangle& t = quads.scan.triangles[triangle];
    const Vec3d a(quads.scan.positions[t[0]]);
    return length(cross(Vec3d(quads.scan.positions[t[1]]) - a, Vec3d(quads.scan.positions[t[2]]) - a));
  };
  double triangles = 0;
  const double step = 1.0 / (grid.side - 1);
  for (std::uint32_t j = 0; j + 1 < grid.side; ++j)
    for (std::uint32_t i = 0; i + 1 < grid.side; ++i) {
      std::uint32_t hit = 0;
      static_cast<void>(quads.at(quad, (i + 0.5) * step, (j + 0.5) * step, &hit));
      const Vec3d diagonal(grid.at(i + 1, j + 1) - grid.at(i, j)),
          other(grid.at(i, j + 1) - grid.at(i + 1, j));
      const double area = triangle_area(hit);
      if (area > 0) triangles += std::min(length(cross(diagonal, other)) / area, 1e6);
    }
  const double steps = std::sqrt(triangles * config.texels_per_triangle);
  return std::bit_ceil(static_cast<std::uint32_t>(std::clamp(steps, 4.0, 4096.0))) + 1;
}

// The coarsest grid that is fine enough.
Grid choose_grid(const Quads& quads, std::size_t quad, const BakeConfig& config, double allowed,
                 bool& is_at_limit) {
  Grid fine = sample(quads, quad, std::min(kFirstSide, config.max_side), {});
  is_at_limit = false;
  for (std::uint32_t stride = fine.side - 1; stride > 1; stride /= 2)
    if (error_without(fine, stride, allowed) <= 1) {
      for (; stride > 1; stride /= 2) fine = every_second(fine);
      return fine;
    }
  const std::uint32_t most = most_side(quads, quad, fine, config);
  for (;;) {
    const Grid finer = sample(quads, quad, 2 * fine.side - 1, fine);
    if (error_without(finer, 2, allowed) <= 1) return fine;
    is_at_limit = finer.side > config.max_side;
    if (is_at_limit || finer.side > most) return fine;
    fine = finer;
  }
}

struct Shares {                                   ///< of the surface's area
  std::vector<std::pair<double, double>> values;  ///< value, area
  double percentile(double fraction) {
    std::sort(values.begin(), values.end());
    double whole = 0, part = 0;
    for (const auto& [value, area] : values) whole += area;
    for (const auto& [value, area] : values)
      if ((part += area) >= whole * fraction) return value;
    return 0;
  }
};

void measure_distortion(const std::vector<Grid>& grids, BakeReport& counts) {
  Shares stretch, area;
  for (const Grid& grid : grids) {
    double whole = 0;
    const std::size_t first = area.values.size();
    for (std::uint32_t j = 0; j + 1 < grid.side; ++j)
      for (std::uint32_t i = 0; i + 1 < grid.side; ++i) {
        const Vec3d origin(grid.at(i, j));
        const Vec3d ds = Vec3d(grid.at(i + 1, j)) - origin, dt = Vec3d(grid.at(i, j + 1)) - origin;
        const double texel = length(cross(ds, dt));
        // The singular values of (ds, dt).
        const double half = (dot(ds, ds) + dot(dt, dt)) / 2;
        const double root = std::sqrt(std::max(0.0, half * half - texel * texel));
        stretch.values.push_back({half > root ? std::sqrt((half + root) / (half - root)) : 1e6, texel});
        area.values.push_back({texel, texel});
        whole += texel;
      }
    const double mean = whole / static_cast<double>(area.values.size() - first);
    for (std::size_t i = first; i < area.values.size(); ++i) {
      double& value = area.values[i].first;
      value = value > 0 && mean > 0 ? std::max(value / mean, mean / value) : 1e6;
    }
  }
  counts.stretch_median = stretch.percentile(0.5);
  counts.stretch_p95 = stretch.percentile(0.95);
  counts.area_p95 = area.percentile(0.95);
}

std::vector<Grid> make_grids(const Quads& quads, const BakeConfig& config, double allowed, BakeReport& counts,
                             const Progress& progress) {
  std::vector<Grid> grids(quads.pairs.size());
  std::vector<std::uint8_t> is_at_limit(grids.size());
  std::size_t done = 0;
  std::mutex mutex;
  parallel_for(grids.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      bool at_limit = false;
      grids[i] = choose_grid(quads, i, config, allowed, at_limit);
      is_at_limit[i] = at_limit;
    }
    const std::lock_guard lock(mutex);
    done += end - begin;
    report(progress, "sampling", static_cast<double>(done) / static_cast<double>(grids.size()));
  });
  for (std::size_t i = 0; i < grids.size(); ++i) {
    const auto level = static_cast<std::size_t>(std::bit_width(grids[i].side - 1) - 1);
    if (counts.patches_of_level.size() <= level) counts.patches_of_level.resize(level + 1);
    ++counts.patches_of_level[level];
    counts.patches_at_limit += is_at_limit[i];
    counts.texels += grids[i].points.size();
  }
  return grids;
}

// Displacements are multiples of a power of two far below what detail allows: their floats end in zeros, and
// the map takes two thirds of the bytes.
void fill_map(const std::vector<Grid>& grids, double allowed, Proxy& proxy) {
  const float quantum = static_cast<float>(std::exp2(std::floor(std::log2(allowed / kQuantaPerDetail))));
  const auto rounded = [&](float x) {
    const float steps = std::round(x / quantum);
    return std::abs(steps) < 0x1p23f ? steps * quantum : x;
  };
  for (std::size_t i = 0; i < grids.size(); ++i) {
    const PatchTile& tile = proxy.tiles[i];
    const std::uint32_t last = tile.side - 1;
    for (std::uint32_t y = 0; y <= last; ++y)
      for (std::uint32_t x = 0; x <= last; ++x) {
        // Base vertices lie on the scan.
        const bool is_corner = (x == 0 || x == last) && (y == 0 || y == last);
        if (is_corner) continue;
        const Vec3f v = grids[i].at(x, y) - base_point(proxy, proxy.quads[i], tile.side, x, y);
        proxy.map[texel_index(proxy, tile, x, y)] = {rounded(v.x), rounded(v.y), rounded(v.z)};
      }
  }
}

double diagonal_of(const Manifold& mesh) {
  Bounds3f box;
  for (const Vec3f& p : mesh.positions) box.add(p);
  return box.diagonal();
}

constexpr std::uint64_t kBytesPerTriangle = 480;  // at a bake's peak, as measured

}  // namespace

void check_bakeable(const Scan& scan, const std::string& file) {
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    const Vec3f& p = scan.positions[i];
    const auto refuse = [&](const char* what) {
      throw Error(ErrorKind::kInput, file, "vertex " + std::to_string(i) + what);
    };
    if (!is_finite(p)) refuse(" is not finite; ingest it first");
    if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= kLargestProxyValue))
      refuse(" is too large: beyond 1e18");
  }
}

std::uint64_t bake_memory(const Scan& scan) { return scan.triangles.size() * kBytesPerTriangle; }

Proxy bake_proxy(const Scan& scan, const std::string& file, const BakeConfig& config, BakeReport& counts,
                 const Progress& progress) {
  if (scan.is_cloud())
    throw Error(ErrorKind::kInput, file, "is a point cloud, and a proxy needs a surface; mesh it first");
  counts = {};
  counts.triangles_in = scan.triangles.size();
  Stopwatch watch;
  report(progress, "joining triangles", 0);
  const Manifold mesh = make_manifold(scan, config.min_component, counts.mesh);
  if (mesh.triangles.empty()) throw Error(ErrorKind::kInput, file, "has no triangle with three corners");
  const double diagonal = diagonal_of(mesh);
  Decimation decimation(mesh, file);
  counts.join_seconds = watch.lap();
  BaseMesh base;
  std::vector<TrianglePair> pairs = make_pairs(decimation, file, config, diagonal, base, counts, progress);
  const SelfMap map = decimation.finish();
  const Quads quads{mesh, base, map, std::move(pairs)};
  counts.base_triangles = base.triangles.size();
  counts.patches = quads.pairs.size();
  counts.folded_steps = map.circle_steps();

  Proxy proxy;
  make_base(quads, proxy);
  const double allowed = config.detail * diagonal;
  watch.lap();
  const std::vector<Grid> grids = make_grids(quads, config, allowed, counts, progress);
  counts.sample_seconds = watch.lap();
  measure_distortion(grids, counts);
  for (const Grid& grid : grids) proxy.tiles.push_back({0, 0, grid.side, 0});
  pack_map(proxy);
  fill_map(grids, allowed, proxy);
  join_edges(proxy);
  for (const PatchTile& tile : proxy.tiles)
    counts.longest_displacement = std::max<double>(counts.longest_displacement, tile.longest_displacement);
  return proxy;
}

}  // namespace rbvh
