#include "pipeline/rbvh/choose_split.h"

#include <algorithm>
#include <limits>

#include "pipeline/rbvh/runs.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kRunLength = 1024;
/// Runs whose bins are on the device at once: 26 MB.
constexpr std::size_t kBinnedRuns = 8192;
constexpr std::size_t kBins = RBVH_SAH_BINS;

void add(SplitBin& to, const SplitBin& from) {
  if (from.count == 0) return;
  for (int k = 0; k < 3; ++k) {
    to.lo[k] = std::min(to.lo[k], from.lo[k]);
    to.hi[k] = std::max(to.hi[k], from.hi[k]);
  }
  to.area += from.area;
  to.count += from.count;
}

SplitBin no_bin() {
  constexpr float kMost = std::numeric_limits<float>::max();
  return {{kMost, kMost, kMost}, 0, {-kMost, -kMost, -kMost}, 0};
}

/// A child's part of equation 1, times the parent's surface.
double split_cost(const SplitBin& side) {
  const auto extent = [&](int axis) {
    return static_cast<double>(side.hi[axis]) - static_cast<double>(side.lo[axis]);
  };
  const double x = extent(0), y = extent(1), z = extent(2);
  return (x * y + y * z + z * x) * static_cast<double>(side.area);
}

SplitGrid split_grid(const PartitionNode& node) {
  SplitGrid grid{};
  for (int axis = 0; axis < 3; ++axis) {
    const float extent = node.sums.hi[axis] - node.sums.lo[axis];
    grid.lo[axis] = node.sums.lo[axis];
    grid.scale[axis] = extent > 0 ? static_cast<float>(kBins) / extent : 0;
  }
  return grid;
}

/// The cheapest plane of a node's bins (3 * kBins), or the spatial median where every one leaves a side
/// empty.
Split best_plane(const PartitionNode& node, const SplitBin* bins) {
  Split best = spatial_median(node);
  double least = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const SplitBin* b = bins + static_cast<std::size_t>(axis) * kBins;
    double right[kBins];
    bool has_right[kBins];
    SplitBin sweep = no_bin();
    for (std::size_t i = kBins; i-- > 1;) {
      add(sweep, b[i]);
      has_right[i] = sweep.count > 0;
      right[i] = split_cost(sweep);
    }
    sweep = no_bin();
    for (std::size_t i = 1; i < kBins; ++i) {
      add(sweep, b[i - 1]);
      if (sweep.count == 0 || !has_right[i]) continue;
      const double cost = split_cost(sweep) + right[i];
      if (!(cost < least)) continue;
      least = cost;
      const float extent = node.sums.hi[axis] - node.sums.lo[axis];
      std::fill_n(best.direction, 3, 0.0f);
      best.direction[axis] = 1;
      best.position = node.sums.lo[axis] + extent * (static_cast<float>(i) / static_cast<float>(kBins));
    }
  }
  return best;
}

void choose_planes(const Partition& partition, const Primitives& primitives,
                   const std::vector<std::uint32_t>& nodes, std::vector<Split>& splits) {
  const Device& device = primitives.device;
  for (std::size_t k = 0; k < nodes.size();) {
    std::vector<Run> list;
    std::vector<SplitGrid> grids;
    const std::size_t first = k;
    for (; k < nodes.size() && list.size() < kBinnedRuns; ++k) {
      const PartitionNode& node = partition.nodes[nodes[k]];
      append_runs(list, static_cast<std::uint32_t>(k - first), node.begin, node.end, kRunLength);
      grids.push_back(split_grid(node));
    }
    const Runs runs = upload_runs(device, std::move(list));
    const Buffer<SplitBin> device_bins(device, std::size_t{runs.count()} * 3 * kBins);
    run_over(device, runs, "build/partition", "partition_bins", Buffer<SplitGrid>(device, grids),
             partition.references, primitives.box_lo, primitives.box_hi, device_bins);
    const std::vector<SplitBin> run_bins = device_bins.read();
    std::vector<SplitBin> bins(3 * kBins);
    for (std::size_t r = 0; r < runs.count();) {
      const std::uint32_t owner = runs.list[r].owner;
      std::fill(bins.begin(), bins.end(), no_bin());
      for (; r < runs.count() && runs.list[r].owner == owner; ++r)
        for (std::size_t i = 0; i < bins.size(); ++i) add(bins[i], run_bins[r * bins.size() + i]);
      splits[first + owner] = best_plane(partition.nodes[nodes[first + owner]], bins.data());
    }
  }
}

}  // namespace

Split spatial_median(const PartitionNode& node) {
  const Bounds3f b = node.bounds();
  const Vec3f e = b.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  Split split{.kind = RBVH_SPLIT_PLANE,
              .direction = {0, 0, 0},
              .position = b.center()[axis],
              .middle = node.begin + node.count() / 2};
  split.direction[axis] = 1;
  return split;
}

std::vector<Split> choose_splits(const Partition& partition, const Primitives& primitives,
                                 const std::vector<std::uint32_t>& nodes) {
  std::vector<Split> splits;
  splits.reserve(nodes.size());
  for (const std::uint32_t n : nodes) splits.push_back(spatial_median(partition.nodes[n]));
  if (partition.rule == SplitRule::kSurfaceArea) choose_planes(partition, primitives, nodes, splits);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const ObjectSet& objects = partition.nodes[nodes[k]].objects;
    if (split_kind(SplitBy::kRule, objects.count) != RBVH_SPLIT_OBJECT) continue;
    splits[k].kind = RBVH_SPLIT_OBJECT;
    splits[k].middle = std::min(objects.ids[0], objects.ids[1]);
  }
  return splits;
}

void add(ObjectSet& to, const ObjectSet& from) {
  const std::uint32_t more = from.count;
  for (std::uint32_t k = 0; k < std::min(more, 2u); ++k) {
    const std::uint32_t id = from.ids[k];
    if (to.count == 0)
      to = {{id, id}, 1};
    else if (to.count == 1 && id != to.ids[0])
      to = {{to.ids[0], id}, 2};
    else if (to.count == 2 && id != to.ids[0] && id != to.ids[1])
      to.count = 3;
  }
  to.count = std::max(to.count, more);
}

}  // namespace rbvh
