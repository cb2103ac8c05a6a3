#include "pipeline/rbvh/refine.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>

#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/rasterize.h"

namespace rbvh {
namespace {

/// Of heights, to the level's error: rounding adds little to it.
constexpr float kQuantum = 0.5f;

/// A level's leaves while they are refined.
struct RefineState {
  const Primitives& primitives;
  const LevelRule& rule;
  bool separates_boundary = false, is_noisy = false;
  Partition partition;  ///< the level's own, with the splits of its faulty tiles
  RefinedLevel result = {};
  std::set<std::uint32_t> uncovered = {};  ///< nodes of triangles that are uncovered in the tile of another

  Hybrid hybrid() const { return rule.config->hybrid; }
};

/// Other levels' splits have changed the order of a node's references, and sums depend on it.
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

void append_children(const Partition& partition, const std::vector<SplitRequest>& requests,
                     std::vector<std::uint32_t>& nodes) {
  for (const SplitRequest& request : requests) {
    nodes.push_back(static_cast<std::uint32_t>(partition.nodes[request.node].left));
    nodes.push_back(static_cast<std::uint32_t>(partition.nodes[request.node].left) + 1);
  }
}

/// The nodes at which a level stops splitting, in the order of the tree.
std::vector<std::uint32_t> leaves_of(const Partition& partition, const LevelRule& rule) {
  std::vector<std::uint32_t> leaves, stack = {0};
  while (!stack.empty()) {
    const std::uint32_t n = stack.back();
    stack.pop_back();
    const PartitionNode& node = partition.nodes[n];
    if (node.left >= 0 && wants_split(rule, node)) {
      stack.push_back(static_cast<std::uint32_t>(node.left) + 1);
      stack.push_back(static_cast<std::uint32_t>(node.left));
    } else {
      leaves.push_back(n);
    }
  }
  return leaves;
}

/// Splits the leaves of which a part is at boundary edges; returns the leaves after that.
std::vector<std::uint32_t> split_boundary(Partition& partition, const Primitives& primitives,
                                          const std::vector<std::uint32_t>& leaves) {
  std::vector<std::uint32_t> result;
  std::vector<SplitRequest> requests;
  for (const std::uint32_t n : leaves) {
    const PartitionNode& node = partition.nodes[n];
    if (has_mixed_boundary(node.sums.boundary, node.count()))
      requests.push_back({n, SplitBy::kBoundary});
    else
      result.push_back(n);
  }
  sort_references(partition, requests);
  split_once(partition, primitives, requests);
  append_children(partition, requests, result);
  return result;
}

RasterConfig raster_config(const RefineState& level, float rho) {
  const bool is_cloud = level.primitives.discs;
  return {.rho = rho,
          .quantum = kQuantum * level.rule.error,
          .separates_boundary = level.separates_boundary,
          .limits = fault_limits({.is_cloud = is_cloud,
                                  .is_noisy = level.is_noisy,
                                  .thickness = level.primitives.thickness * std::sqrt(rho)})};
}

LeafDecision decide(const RefineState& level, const Tile& tile) {
  const PartitionNode& node = level.partition.nodes[tile.node];
  return decide_leaf({.primitives = node.count(),
                      .texels = std::uint32_t{tile.leaf.width} * tile.leaf.height,
                      .surface_texels = texels_per_area(level.rule, node) * node.sums.area,
                      .is_faulty = tile.flaws.any() || (level.separates_boundary && node.sums.boundary > 0),
                      .is_uncovered_group = level.uncovered.contains(tile.node)},
                     level.hybrid());
}

/// Rasterises these leaves, appends the finished tiles, and returns how the faulty ones are to be split.
std::vector<SplitRequest> rasterize_leaves(RefineState& level, const std::vector<std::uint32_t>& leaves) {
  RefinedLevel& result = level.result;
  // Leaves of equal density together: without a focus, all.
  std::map<float, std::vector<std::uint32_t>> by_rho;
  for (const std::uint32_t n : leaves)
    by_rho[texels_per_area(level.rule, level.partition.nodes[n])].push_back(n);
  std::vector<SplitRequest> requests;
  for (const auto& [rho, group] : by_rho)
    for (const Tile& tile : rasterize_tiles(
             level.primitives, level.partition, group, raster_config(level, rho),
             [&](const Tile& draft) { return decide(level, draft); }, result.texels)) {
      if (tile.decision != LeafDecision::kSplit) {
        result.tiles.push_back(tile);
        continue;
      }
      const FaultSplit split = choose_fault_split(tile.flaws);
      requests.push_back(
          {tile.node, split.by, tile.w, split.by == SplitBy::kHeight ? tile.middle : split.cosine});
    }
  return requests;
}

/// Splits uncovered triangles off the tiles, from the given one on, that do not show them. Returns the nodes
/// of these triangles, which are to be leaves of their own. A tile that shows none of its triangles is such a
/// leaf already.
std::vector<std::uint32_t> split_uncovered(RefineState& level, std::size_t first_tile) {
  Partition& partition = level.partition;
  std::vector<SplitRequest> requests;
  std::vector<std::uint32_t> references;
  for (Tile& tile : std::span(level.result.tiles).subspan(first_tile)) {
    if (tile.decision != LeafDecision::kRasterize) continue;
    const PartitionNode& node = partition.nodes[tile.node];
    const auto count = static_cast<std::uint32_t>(tile.uncovered.size());
    const LeafDecision decision = decide_uncovered(count, node.count());
    if (decision != LeafDecision::kSplit) {
      tile.decision = decision;
      continue;
    }
    if (references.empty()) references = partition.references.read();
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
  if (!requests.empty()) partition.references.write(std::span<const std::uint32_t>(references));
  split_once(partition, level.primitives, requests);
  std::vector<std::uint32_t> split_off;
  split_off.reserve(requests.size());
  for (const SplitRequest& request : requests)
    split_off.push_back(static_cast<std::uint32_t>(partition.nodes[request.node].left));
  return split_off;
}

/// The level's own copy of the partition, and what holds for the level as a whole.
RefineState start_refining(const Primitives& primitives, const Partition& partition, const LevelRule& rule) {
  const PartitionNode& root = partition.nodes[0];
  const Hybrid hybrid = rule.config->hybrid;
  const BoundaryFacts scan{root.sums.boundary, static_cast<float>(root.count()),
                           texels_per_area(rule, root) * root.sums.area};
  RefineState level{.primitives = primitives,
                    .rule = rule,
                    .separates_boundary = separates_boundary(hybrid, scan),
                    .is_noisy = is_noisy_mesh(primitives.area, static_cast<double>(root.sums.area)),
                    .partition = {.nodes = partition.nodes,
                                  .references = Buffer<std::uint32_t>(primitives.device, primitives.count),
                                  .cones = false,
                                  .rule = partition.rule,
                                  .host = partition.host}};
  level.partition.references.copy_from(partition.references, primitives.count);
  return level;
}

/// Lists the primitives of the leaves that hold these. Those from `own` on go, and so do leaves of such
/// alone.
void list_primitives(RefineState& level, std::uint32_t own) {
  const std::vector<std::uint32_t> references = level.partition.references.read(),
                                   order = level.primitives.order.read();
  std::vector<Tile> tiles;
  for (const Tile& tile : level.result.tiles) {
    const PartitionNode& node = level.partition.nodes[tile.node];
    std::vector<std::uint32_t> held;
    for (std::uint32_t i = node.begin; i < node.end; ++i)
      if (order[references[i]] < own) held.push_back(order[references[i]]);
    if (held.empty()) continue;
    if (tile.decision != LeafDecision::kPrimitives) held.clear();
    tiles.push_back(tile);
    level.result.held.push_back(std::move(held));
  }
  level.result.tiles = std::move(tiles);
}

}  // namespace

RefinedLevel refine_level(const Primitives& primitives, const Partition& partition, const LevelRule& rule,
                          std::uint32_t own_primitives, Stopwatch& watch, BuildTimings& time) {
  RefineState level = start_refining(primitives, partition, rule);
  Partition& own = level.partition;
  std::vector<std::uint32_t> leaves = leaves_of(partition, rule);
  if (level.separates_boundary) leaves = split_boundary(own, primitives, leaves);
  // The level's leaves, then the children of those whose tiles are faulty.
  for (bool is_first = true; !leaves.empty(); is_first = false) {
    const std::size_t first_tile = level.result.tiles.size();
    const std::vector<SplitRequest> requests = rasterize_leaves(level, leaves);
    time.rasterize += watch.lap();
    if (is_first && !requests.empty()) sort_references(own, requests);
    split_once(own, primitives, requests);
    leaves.clear();
    append_children(own, requests, leaves);
    for (std::size_t k = 0; k < requests.size(); ++k)
      if (level.uncovered.contains(requests[k].node))
        level.uncovered.insert({leaves[2 * k], leaves[2 * k + 1]});
    if (level.hybrid() == Hybrid::kAuto) {
      const std::vector<std::uint32_t> split_off = split_uncovered(level, first_tile);
      level.uncovered.insert(split_off.begin(), split_off.end());
      leaves.insert(leaves.end(), split_off.begin(), split_off.end());
    }
    time.partition += watch.lap();
  }
  list_primitives(level, own_primitives);
  return std::move(level.result);
}

}  // namespace rbvh
