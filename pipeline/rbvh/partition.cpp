#include "pipeline/rbvh/partition.h"

#include <numeric>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/choose_split.h"
#include "pipeline/rbvh/partition_host.h"
#include "pipeline/rbvh/runs.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kRunLength = 1024;

void add(PrimitiveSums& to, const PrimitiveSums& from) {
  if (from.count == 0) return;
  if (to.count == 0) {
    to = from;
    return;
  }
  for (int k = 0; k < 3; ++k) {
    to.lo[k] = std::min(to.lo[k], from.lo[k]);
    to.hi[k] = std::max(to.hi[k], from.hi[k]);
    to.area_normal[k] += from.area_normal[k];
  }
  to.area += from.area;
  to.boundary += from.boundary;
  to.count += from.count;
}

/// The cones around the mean normals of nodes[first..] ([SAE93], approximated as in the paper).
void measure_cones(Partition& partition, const Primitives& primitives, std::size_t first) {
  const Device& device = primitives.device;
  std::vector<Run> list;
  std::vector<Float4> axes;
  for (std::size_t n = first; n < partition.nodes.size(); ++n) {
    const PartitionNode& node = partition.nodes[n];
    append_runs(list, static_cast<std::uint32_t>(n - first), node.begin, node.end, kRunLength);
    const float* sum = node.sums.area_normal;
    const Vec3f axis = normalized(Vec3f{sum[0], sum[1], sum[2]});
    axes.push_back({axis.x, axis.y, axis.z, 0});
  }
  const Runs runs = upload_runs(device, std::move(list));
  const Buffer<float> device_cosines(device, runs.count());
  run_over(device, runs, "build/partition", "partition_cones", Buffer<Float4>(device, axes),
           partition.references, primitives.area_normal, device_cosines);
  const std::vector<float> cosines = device_cosines.read();
  for (std::size_t r = 0; r < cosines.size(); ++r) {
    float& least = partition.nodes[first + runs.list[r].owner].cone_cosine;
    least = std::min(least, cosines[r]);
  }
}

/// The objects of nodes[first..], where the scan has several.
void find_objects(Partition& partition, const Primitives& primitives, std::size_t first) {
  if (!primitives.has_objects) return;
  const Device& device = primitives.device;
  std::vector<Run> list;
  for (std::size_t n = first; n < partition.nodes.size(); ++n) {
    PartitionNode& node = partition.nodes[n];
    node.objects.count = 0;
    append_runs(list, static_cast<std::uint32_t>(n), node.begin, node.end, kRunLength);
  }
  const Runs runs = upload_runs(device, std::move(list));
  const Buffer<ObjectSet> sets(device, runs.count());
  run_over(device, runs, "build/partition", "partition_objects", partition.references, primitives.objects,
           sets);
  const std::vector<ObjectSet> found = sets.read();
  for (std::size_t r = 0; r < found.size(); ++r) add(partition.nodes[runs.list[r].owner].objects, found[r]);
}

}  // namespace

Partition make_root(const Primitives& primitives, bool cones, SplitRule rule, PartitionWhere where) {
  if (where == PartitionWhere::kHost) return make_root_on_host(primitives, cones, rule);
  const Device& device = primitives.device;
  std::vector<std::uint32_t> identity(primitives.count);
  std::iota(identity.begin(), identity.end(), 0u);
  Partition partition{
      .nodes = {}, .references = Buffer<std::uint32_t>(device, identity), .cones = cones, .rule = rule};
  std::vector<Run> list;
  append_runs(list, 0, 0, primitives.count, kRunLength);
  const Runs runs = upload_runs(device, std::move(list));
  const Buffer<PrimitiveSums> sums(device, runs.count());
  run_over(device, runs, "build/partition", "partition_reduce", partition.references, primitives.box_lo,
           primitives.box_hi, primitives.area_normal, sums);
  PartitionNode root;
  root.end = primitives.count;
  for (const PrimitiveSums& s : sums.read()) add(root.sums, s);
  partition.nodes.push_back(root);
  if (cones) measure_cones(partition, primitives, 0);
  find_objects(partition, primitives, 0);
  return partition;
}

namespace {

/// One level of the breadth-first construction: splits `active` as `splits` say; new nodes are appended.
void split_level(Partition& partition, const Primitives& primitives, const std::vector<std::uint32_t>& active,
                 std::vector<Split> splits) {
  const Device& device = primitives.device;
  std::vector<PartitionNode>& nodes = partition.nodes;
  std::vector<Run> list;
  for (std::uint32_t k = 0; k < active.size(); ++k)
    append_runs(list, k, nodes[active[k]].begin, nodes[active[k]].end, kRunLength);
  const Runs runs = upload_runs(device, std::move(list));
  const Buffer<std::uint8_t> sides(device, primitives.count);

  std::vector<PrimitiveSums> sums, children;
  const Buffer<PrimitiveSums> device_sums(device, std::size_t{2} * runs.count());
  for (bool stuck = true; stuck;) {
    run_over(device, runs, "build/partition", "partition_choose", Buffer<Split>(device, splits),
             partition.references, primitives.box_lo, primitives.box_hi, primitives.area_normal,
             primitives.objects, sides, device_sums);
    sums = device_sums.read();
    children.assign(2 * active.size(), {});
    for (std::size_t r = 0; r < runs.count(); ++r) {
      const std::size_t left = std::size_t{2} * runs.list[r].owner;
      add(children[left], sums[2 * r]);
      add(children[left + 1], sums[2 * r + 1]);
    }
    stuck = false;
    for (std::size_t k = 0; k < active.size(); ++k) {
      if (children[2 * k].count != 0 && children[2 * k + 1].count != 0) continue;
      stuck = true;
      const std::uint32_t kind = next_split_kind(splits[k].kind);
      if (kind == RBVH_SPLIT_PLANE) splits[k] = spatial_median(nodes[active[k]]);
      splits[k].kind = kind;
    }
  }

  std::vector<std::uint32_t> targets(std::size_t{2} * runs.count());
  std::uint32_t at[2] = {0, 0};
  for (std::size_t r = 0; r < runs.count(); ++r) {
    const Run& run = runs.list[r];
    const PartitionNode& node = nodes[active[run.owner]];
    if (run.begin == node.begin) {
      at[0] = node.begin;
      at[1] = node.begin + children[std::size_t{2} * run.owner].count;
    }
    for (std::uint32_t side = 0; side < 2; ++side) {
      targets[2 * r + side] = at[side];
      at[side] += sums[2 * r + side].count;
    }
  }
  const Buffer<std::uint32_t> moved(device, primitives.count);
  run_over(device, runs, "build/partition", "partition_scatter", Buffer<std::uint32_t>(device, targets),
           partition.references, sides, moved);
  run_over(device, runs, "build/partition", "partition_copy", moved, partition.references);

  const std::size_t first_child = nodes.size();
  for (std::size_t k = 0; k < active.size(); ++k) {
    PartitionNode& node = nodes[active[k]];
    node.left = static_cast<std::int32_t>(first_child + 2 * k);
    const std::uint32_t begin = node.begin, end = node.end, middle = begin + children[2 * k].count;
    nodes.push_back({.sums = children[2 * k], .begin = begin, .end = middle});
    nodes.push_back({.sums = children[2 * k + 1], .begin = middle, .end = end});
  }
  if (partition.cones) measure_cones(partition, primitives, first_child);
  find_objects(partition, primitives, first_child);
  device.finish();
}

}  // namespace

void split_nodes(Partition& partition, const Primitives& primitives, std::vector<std::uint32_t> active,
                 const std::function<bool(const PartitionNode&)>& wants_split, const Progress& progress) {
  if (partition.host != nullptr)
    return split_nodes_on_host(partition, std::move(active), wants_split, progress);
  const std::vector<PartitionNode>& nodes = partition.nodes;
  std::erase_if(active, [&](std::uint32_t n) { return nodes[n].count() < 2; });
  while (!active.empty()) {
    const std::size_t first_child = nodes.size();
    split_level(partition, primitives, active, choose_splits(partition, primitives, active));
    active.clear();
    std::size_t left_to_do = 0;
    for (auto child = static_cast<std::uint32_t>(first_child); child < nodes.size(); ++child) {
      if (nodes[child].count() < 2 || !wants_split(nodes[child])) continue;
      active.push_back(child);
      left_to_do += nodes[child].count();
    }
    report(progress, "partition",
           1.0 - static_cast<double>(left_to_do) / static_cast<double>(primitives.count));
  }
}

void split_once(Partition& partition, const Primitives& primitives,
                const std::vector<SplitRequest>& requests) {
  if (requests.empty()) return;
  if (partition.host != nullptr) return split_once_on_host(partition, requests);
  std::vector<std::uint32_t> active;
  active.reserve(requests.size());
  for (const SplitRequest& request : requests) active.push_back(request.node);
  std::vector<Split> splits = choose_splits(partition, primitives, active);
  for (std::size_t k = 0; k < requests.size(); ++k) {
    const SplitRequest& request = requests[k];
    const PartitionNode& node = partition.nodes[request.node];
    const std::uint32_t kind = split_kind(request.by, node.objects.count);
    const bool is_given = kind == RBVH_SPLIT_PLANE && request.by == SplitBy::kHeight;
    if (!is_given && (kind == RBVH_SPLIT_PLANE || kind == RBVH_SPLIT_OBJECT)) continue;  // as they are
    splits[k] = spatial_median(node);
    splits[k].kind = kind;
    if (request.by == SplitBy::kFirst) splits[k].middle = node.begin + request.first;
    std::copy_n(&request.direction.x, 3, splits[k].direction);
    splits[k].position = request.position;
  }
  split_level(partition, primitives, active, std::move(splits));
}

}  // namespace rbvh
