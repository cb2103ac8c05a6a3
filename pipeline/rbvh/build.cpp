#include "pipeline/rbvh/build.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <span>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/top_tree.h"
#include "pipeline/rbvh/atlas.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/tile.h"

namespace rbvh {
namespace {

/// Adds to a phase what has passed since its last lap.
struct PhaseClock {
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();

  void lap(double& phase) {
    const auto now = std::chrono::steady_clock::now();
    phase += std::chrono::duration<double>(now - start).count();
    start = now;
  }
};

/// Nodes of no more texels than this are not split for their shape's sake: noise would be split for ever.
constexpr float kFloorTexels = 16;
/// A faulty tile is split further, down to this.
constexpr float kFaultFloorTexels = 4;
constexpr std::uint32_t kFloorPrimitives = 4;
/// In scan units squared.
constexpr float kLeastArea = 1e-15f, kMostArea = 1e17f;
/// Discs that lie further apart than this where they overlap are noise that a tile would not show as they do.
constexpr float kNoiseTexels = 0.1f;
/// Texels past a disc that it speaks for: the rim is the scan's own roughness, and must not have holes.
constexpr float kDiscReach = 2;
/// A mesh whose noise adds more than this to its area (primitives_smooth_areas) is noisy all over: how single
/// triangles stand says nothing, and only steps and misses of more than kNoisyStep texels are worth a split.
constexpr double kNoisyArea = 1.1;
constexpr float kNoisyStep = 8;
/// A leaf of no more primitives than this may keep them; of a faulty tile.
constexpr std::uint32_t kMostExact = 64, kMostFaulty = 32;
/// Texels that take as many bytes in the file as a primitive, measured: 3.4 bytes each against 36.
constexpr std::uint32_t kTexelsPerExact = 11;

/// Rims are kept as they are where they are less than this part of the scan (else it is a soup of pieces),
/// and their triangles have this many texels each.
constexpr float kMostRims = 0.25f, kLeastRimTexels = 0.5f;

/// Triangles kept for want of a tile that shows them are together in a leaf whose rectangle has no more than
/// this many texels for each.
constexpr std::uint32_t kMaxUncoveredTexels = 64;

/// Where the focus asks for texels so different within one node, it is split.
constexpr float kMostRhoRange = 4;

struct LevelRule {
  LevelConfig level;
  const BuildConfig* config = nullptr;
  float area = 1;  ///< that rho is for, scan units squared

  LevelConfig quality(const PartitionNode& node) const {
    if (!config->focus) return level;
    return quality_at(level, &*config->focus, distances(node.bounds(), config->focus->center).nearest);
  }
  /// Per scan unit squared.
  float rho(const PartitionNode& node) const { return quality(node).rho / area; }

  bool wants_split(const PartitionNode& node) const {
    if (node.objects.count == 2) return true;  // a tile of both would fuse them
    const LevelConfig here = quality(node);
    const float texels = here.rho / area * node.sums.area;
    const float largest_tile =
        config->tile_side > 0 ? config->tile_side : optimal_resolution(here.rho, config->rays);
    if (tile_resolution(node, here.rho / area) > largest_tile) return true;
    if (node.count() <= kFloorPrimitives || texels <= kFloorTexels) return false;
    if (config->focus) {
      const float farthest = distances(node.bounds(), config->focus->center).farthest;
      if (here.rho > kMostRhoRange * quality_at(level, &*config->focus, farthest).rho) return true;
    }
    if (config->refinement == Refinement::kConeOfNormals)
      return node.cone_cosine < std::cos(here.phi_degrees * std::numbers::pi_v<float> / 180);
    return node.projected_area() < here.alpha * node.sums.area;
  }
};

bool keeps_primitives(Hybrid hybrid, const Tile& tile, bool keeps_discs) {
  if (hybrid == Hybrid::kOff || tile.leaf.primitives > kMostExact) return false;
  if (hybrid == Hybrid::kAlways || keeps_discs) return true;
  const std::uint32_t texels = std::uint32_t{tile.leaf.width} * tile.leaf.height;
  return (tile.is_faulty && tile.leaf.primitives <= kMostFaulty) ||
         texels >= kTexelsPerExact * tile.leaf.primitives;
}

RasterConfig raster_config(float rho, const Primitives& primitives, bool keeps_discs, bool boundary_apart,
                           bool is_noisy) {
  RasterConfig raster{.boundary_apart = boundary_apart, .rho = rho};
  if (primitives.discs) raster.own_reach = raster.reach = kDiscReach;
  if (keeps_discs) {
    raster.layer_gap = kNoiseTexels;
  } else if (primitives.discs) {
    // A cloud's noise is of the order of its discs: closer than that, nothing is a layer or a step.
    const float noise = primitives.mean_radius * std::sqrt(rho);
    raster.layer_gap = std::max(raster.layer_gap, noise);
    raster.step_limit = std::max(raster.step_limit, noise);
  } else if (is_noisy) {
    raster.step_limit = raster.miss_limit = kNoisyStep;
    raster.steep_limit = std::numeric_limits<float>::infinity();
  }
  return raster;
}

/// Other levels' splits have left the references of a node in an order of their own, and sums depend on it.
void sort_references(Partition& partition, const std::vector<SplitRequest>& requests) {
  std::vector<std::uint32_t> references = partition.references.read();
  parallel_for(requests.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const PartitionNode& node = partition.nodes[requests[i].node];
      std::sort(references.begin() + node.begin, references.begin() + node.end);
    }
  });
  partition.references.write(std::span<const std::uint32_t>(references));
}

/// Puts what lies together into the same RBVH_CHUNK places, by halving along the longest axis.
void sort_into_chunks(std::span<std::uint32_t> references, const std::vector<float>& shapes, bool discs) {
  const auto center = [&](std::uint32_t i) {
    const float* s = shapes.data() + 9 * std::size_t{i};
    const Vec3f p{s[0], s[1], s[2]};
    return discs ? p : (p + Vec3f{s[3], s[4], s[5]} + Vec3f{s[6], s[7], s[8]}) * (1.0f / 3);
  };
  // By number first: the order they come in depends on what other levels split.
  std::sort(references.begin(), references.end());
  if (references.size() <= RBVH_CHUNK) return;
  Bounds3f box;
  for (const std::uint32_t i : references) box.add(center(i));
  const Vec3f e = box.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  std::stable_sort(references.begin(), references.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return center(a)[axis] < center(b)[axis]; });
  const std::size_t chunks = (references.size() + RBVH_CHUNK - 1) / RBVH_CHUNK,
                    middle = chunks / 2 * RBVH_CHUNK;
  sort_into_chunks(references.first(middle), shapes, discs);
  sort_into_chunks(references.subspan(middle), shapes, discs);
}

/// The primitives of the tiles that keep them.
void keep_primitives(Level& level, const std::vector<Tile>& tiles, const std::vector<std::uint32_t>& order,
                     const Partition& partition, const Primitives& primitives) {
  std::vector<std::uint32_t> references;
  std::vector<float> shapes;
  for (std::uint32_t leaf = 0; leaf < order.size(); ++leaf) {
    const Tile& tile = tiles[order[leaf]];
    if (!tile.is_exact) continue;
    if (references.empty()) {
      references = partition.references.read();
      shapes = primitives.shape.read();
    }
    const PartitionNode& node = partition.nodes[tile.node];
    sort_into_chunks(std::span(references).subspan(node.begin, node.count()), shapes, primitives.discs);
    level.exact_leaves.push_back({leaf, static_cast<std::uint32_t>(level.exact_primitives.size())});
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      RbvhPrimitive& primitive = level.exact_primitives.emplace_back();
      std::copy_n(shapes.begin() + 9 * static_cast<std::ptrdiff_t>(references[i]), 9, primitive.shape);
      if (!primitives.discs) continue;
      const Vec3f normal = normalized(Vec3f{primitive.shape[4], primitive.shape[5], primitive.shape[6]});
      std::copy_n(&normal.x, 3, primitive.shape + 4);
    }
  }
  level.exact_discs = primitives.discs;
}

Level finish_level(const LevelConfig& config, std::vector<Tile>& tiles, const TileTexels& texels,
                   const Partition& partition, const Primitives& primitives) {
  Level level;
  level.name = config.name;
  level.rho = config.rho;
  level.alpha = config.alpha;
  level.phi_degrees = config.phi_degrees;
  const AtlasSize size = pack_tiles(tiles);
  level.atlas_width = size.width;
  level.atlas_height = size.height;
  level.layers.push_back({"height", 1, assemble_layer(tiles, texels.heights, size)});
  level.layers.push_back({"normal", 1, assemble_layer(tiles, texels.normals, size)});
  if (primitives.has_colors) level.layers.push_back({"color", 1, assemble_layer(tiles, texels.colors, size)});

  std::vector<Bounds3f> boxes(tiles.size());
  for (std::size_t k = 0; k < tiles.size(); ++k) boxes[k] = tiles[k].bounds;
  TopTree tree = build_top_tree(boxes);
  level.nodes = std::move(tree.nodes);
  for (const std::uint32_t k : tree.order) {
    level.leaves.push_back(tiles[k].leaf);
    level.bounds.add(tiles[k].bounds);
    level.texels_used += tiles[k].texels_used;
  }
  keep_primitives(level, tiles, tree.order, partition, primitives);
  return level;
}

void append_children(const Partition& partition, const std::vector<SplitRequest>& requests,
                     std::vector<std::uint32_t>& nodes) {
  for (const SplitRequest& request : requests) {
    nodes.push_back(static_cast<std::uint32_t>(partition.nodes[request.node].left));
    nodes.push_back(static_cast<std::uint32_t>(partition.nodes[request.node].left) + 1);
  }
}

/// The nodes at which a level stops splitting, in the order of the tree.
std::vector<std::uint32_t> leaves_of(const Partition& partition, const LevelRule& rule) {
  std::vector<std::uint32_t> leaves, open = {0};
  while (!open.empty()) {
    const std::uint32_t n = open.back();
    open.pop_back();
    const PartitionNode& node = partition.nodes[n];
    if (node.left >= 0 && rule.wants_split(node)) {
      open.push_back(static_cast<std::uint32_t>(node.left) + 1);
      open.push_back(static_cast<std::uint32_t>(node.left));
    } else {
      leaves.push_back(n);
    }
  }
  return leaves;
}

/// Does the level keep what touches the surface's rim as it is? Tiles end at whole texels.
bool keeps_boundary(const LevelRule& rule, const PartitionNode& root) {
  const auto count = static_cast<float>(root.count());
  return rule.config->hybrid == Hybrid::kAuto && root.sums.boundary > 0 &&
         root.sums.boundary < kMostRims * count && rule.rho(root) * root.sums.area > kLeastRimTexels * count;
}

/// Splits leaves of which a part touches the rim. Returns what is leaf then.
std::vector<std::uint32_t> split_boundary(Partition& own, const Primitives& primitives,
                                          const std::vector<std::uint32_t>& leaves) {
  std::vector<std::uint32_t> kept;
  std::vector<SplitRequest> requests;
  for (const std::uint32_t n : leaves) {
    const PartitionNode& node = own.nodes[n];
    if (node.sums.boundary > 0 && node.sums.boundary < static_cast<float>(node.count()))
      requests.push_back({n, SplitBy::kBoundary});
    else
      kept.push_back(n);
  }
  sort_references(own, requests);
  split_once(own, primitives, requests);
  append_children(own, requests, kept);
  return kept;
}

/// Parts triangles that their tiles do not show from them: the nodes returned are to be leaves of their own.
/// A tile that shows none is one already.
std::vector<std::uint32_t> split_uncovered(Partition& own, const Primitives& primitives,
                                           std::span<Tile> tiles) {
  std::vector<SplitRequest> requests;
  std::vector<std::uint32_t> references;
  for (Tile& tile : tiles) {
    if (tile.is_exact || tile.uncovered.empty()) continue;
    const PartitionNode& node = own.nodes[tile.node];
    const auto count = static_cast<std::uint32_t>(tile.uncovered.size());
    if (count == node.count()) {
      tile.is_exact = count <= kMostExact;
      continue;
    }
    if (references.empty()) references = own.references.read();
    std::vector<std::uint32_t> uncovered, shown;
    for (std::uint32_t i = node.begin; i < node.end; ++i)
      (std::binary_search(tile.uncovered.begin(), tile.uncovered.end(), i) ? uncovered : shown)
          .push_back(references[i]);
    std::sort(uncovered.begin(), uncovered.end());
    std::copy(shown.begin(), shown.end(),
              std::copy(uncovered.begin(), uncovered.end(), references.begin() + node.begin));
    tile.leaf.primitives -= count;
    requests.push_back({.node = tile.node, .by = SplitBy::kFirst, .first = count});
  }
  if (!requests.empty()) own.references.write(std::span<const std::uint32_t>(references));
  split_once(own, primitives, requests);
  std::vector<std::uint32_t> parted(requests.size());
  for (std::size_t k = 0; k < requests.size(); ++k)
    parted[k] = static_cast<std::uint32_t>(own.nodes[requests[k].node].left);
  return parted;
}

Level build_level(const Device& device, const Primitives& primitives, const Partition& partition,
                  const LevelRule& rule, PhaseClock& clock, BuildTimings& time) {
  const Hybrid hybrid = rule.config->hybrid;
  // Where texels are finer than a cloud's discs, the discs themselves are as few bytes, and exact.
  const bool keeps_discs = primitives.discs && hybrid != Hybrid::kOff &&
                           rule.level.rho >= 2 * static_cast<float>(primitives.count);
  // Splits for a level's own faults are made on a copy, so that no level depends on another.
  Partition own{.nodes = partition.nodes,
                .references = Buffer<std::uint32_t>(device, primitives.count),
                .cones = false,
                .rule = rule.config->split,
                .host = partition.host};
  own.references.copy_from(partition.references, primitives.count);
  std::vector<std::uint32_t> leaves = leaves_of(partition, rule);
  const bool boundary_apart = keeps_boundary(rule, partition.nodes[0]);
  if (boundary_apart) leaves = split_boundary(own, primitives, leaves);
  const bool is_noisy = primitives.area > kNoisyArea * static_cast<double>(partition.nodes[0].sums.area);
  std::set<std::uint32_t> uncovered;  // nodes of triangles that no tile shows
  const auto is_final = [&](Tile& tile) {
    const PartitionNode& node = own.nodes[tile.node];
    if (boundary_apart && node.sums.boundary > 0) tile.is_faulty = true;
    tile.leaf.object_id = std::min(node.objects.ids[0], node.objects.ids[1]);
    if (uncovered.contains(tile.node)) {
      const std::uint32_t texels = std::uint32_t{tile.leaf.width} * tile.leaf.height;
      return tile.is_exact = node.count() == 1 ||
                             (node.count() <= kMostExact && texels <= kMaxUncoveredTexels * node.count());
    }
    tile.is_exact = keeps_primitives(hybrid, tile, keeps_discs);
    const bool may_split = keeps_discs || rule.rho(node) * node.sums.area > kFaultFloorTexels;
    return tile.is_exact || node.count() == 1 ||
           (hybrid != Hybrid::kAlways && !(tile.is_faulty && may_split));
  };
  std::vector<Tile> tiles;
  TileTexels texels;
  // The level's leaves, then the children of those whose tile turned out faulty, until all is well or small.
  for (bool is_first = true; !leaves.empty(); is_first = false) {
    // Those of equal quality together: without a focus, all.
    std::map<float, std::vector<std::uint32_t>> by_rho;
    for (const std::uint32_t n : leaves) by_rho[rule.rho(own.nodes[n])].push_back(n);
    std::vector<SplitRequest> requests;
    const std::size_t first_tile = tiles.size();
    for (const auto& [rho, group] : by_rho)
      for (const Tile& tile : rasterize_tiles(
               primitives, own, group, raster_config(rho, primitives, keeps_discs, boundary_apart, is_noisy),
               is_final, texels)) {
        if (tile.is_final)
          tiles.push_back(tile);
        else
          requests.push_back({tile.node, tile.has_back || tile.is_steep ? SplitBy::kFacing : SplitBy::kRule,
                              tile.w, tile.has_back ? 0.0f : RBVH_STEEP_COSINE});
      }
    clock.lap(time.rasterize);
    if (is_first && !requests.empty()) sort_references(own, requests);
    split_once(own, primitives, requests);
    leaves.clear();
    append_children(own, requests, leaves);
    for (std::size_t k = 0; k < requests.size(); ++k)
      if (uncovered.contains(requests[k].node)) uncovered.insert({leaves[2 * k], leaves[2 * k + 1]});
    if (hybrid == Hybrid::kAuto) {
      const std::vector<std::uint32_t> parted =
          split_uncovered(own, primitives, std::span(tiles).subspan(first_tile));
      uncovered.insert(parted.begin(), parted.end());
      leaves.insert(leaves.end(), parted.begin(), parted.end());
    }
    clock.lap(time.partition);
  }
  Level level = finish_level(rule.level, tiles, texels, own, primitives);
  clock.lap(time.pack);
  return level;
}

}  // namespace

float optimal_resolution(float rho, RaysKind rays) {
  return std::max(
      8.0f, rays == RaysKind::kCoherent ? 5.76f * std::log(rho) - 42.99f : 1.23f * std::log(rho) - 0.17f);
}

const std::vector<LevelConfig>& standard_levels() {
  static const std::vector<LevelConfig> levels = {{"Q0", 2e6f, 0.85f, 45},
                                                  {"Q1", 1e6f, 0.80f, 50},
                                                  {"Q2", 512e3f, 0.75f, 55},
                                                  {"Q3", 128e3f, 0.70f, 60},
                                                  {"Q4", 32e3f, 0.65f, 65}};
  return levels;
}

Rbvh build_rbvh(const Device& device, const Scan& scan, const BuildConfig& config, const Progress& progress,
                BuildTimings* timings) {
  BuildTimings local;
  BuildTimings& time = timings != nullptr ? *timings : local;
  time = {};
  PhaseClock clock;
  report(progress, "upload", 0);
  const Primitives primitives = upload_primitives(device, scan);
  const bool cones = config.refinement == Refinement::kConeOfNormals;
  Partition partition = make_root(primitives, cones, config.split, config.partition);
  const float own_area = partition.nodes[0].sums.area;
  const float area = config.area > 0 && own_area > 0 ? static_cast<float>(config.area) : own_area;
  if (!(area > 0)) throw Error(ErrorKind::kInput, "", "the scan has no area");
  // Squares of areas must stay within float on the device.
  if (!(area >= kLeastArea && area <= kMostArea))
    throw Error(
        ErrorKind::kInput, "",
        "the scan's area is beyond what float can work with; scale it to a size between 1e-6 and 1e8");
  clock.lap(time.upload);

  std::vector<LevelRule> rules;
  for (const LevelConfig& level : config.levels) rules.push_back({level, &config, area});
  const auto any_level_splits = [&](const PartitionNode& node) {
    return std::any_of(rules.begin(), rules.end(), [&](const LevelRule& r) { return r.wants_split(node); });
  };
  if (any_level_splits(partition.nodes[0]))
    split_nodes(partition, primitives, {0}, any_level_splits, progress);
  clock.lap(time.partition);

  Rbvh rbvh;
  for (const LevelRule& rule : rules) {
    report(progress, "tiles", static_cast<double>(rbvh.levels.size()) / static_cast<double>(rules.size()));
    PhaseClock level_clock;
    rbvh.levels.push_back(build_level(device, primitives, partition, rule, clock, time));
    time.levels.push_back({rule.level.name, 0});
    level_clock.lap(time.levels.back().seconds);
  }
  report(progress, "tiles", 1);
  rbvh.source.vertices = scan.positions.size();
  rbvh.source.triangles = scan.triangles.size();
  rbvh.source.area = area;
  rbvh.source.shift = scan.shift;
  rbvh.source.bounds = bounds(scan);
  return rbvh;
}

}  // namespace rbvh
