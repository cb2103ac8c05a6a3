#include "pipeline/rbvh/partition_host.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <optional>
#include <span>

namespace rbvh {
namespace {

/// Candidates along each axis, at equal distances: "the best from 32 split candidates" (table 1 of the
/// paper).
constexpr int kPlanes = 32;

using References = std::span<std::uint32_t>;
using GoesLeft = std::function<bool(std::uint32_t primitive)>;

Vec3d xyz(const Float4& v) { return Vec3d(Vec3f{v.x, v.y, v.z}); }

Bounds3d box_of(const HostPrimitives& p, std::uint32_t i) { return {xyz(p.box_lo[i]), xyz(p.box_hi[i])}; }

/// The objects of some primitives: the first two found, and how many; 3 for more.
ObjectSet objects_of(const HostPrimitives& p, References references) {
  ObjectSet set{{0, 0}, 1};
  if (p.objects.empty()) return set;
  set.ids[0] = set.ids[1] = p.objects[references[0]];
  for (const std::uint32_t i : references) {
    const std::uint32_t id = p.objects[i];
    if (id == set.ids[0] || (set.count > 1 && id == set.ids[1])) continue;
    if (set.count == 1) set.ids[1] = id;
    set.count = std::min(set.count + 1, 3u);
  }
  return set;
}

PartitionNode make_node(const Partition& partition, References all, std::uint32_t begin, std::uint32_t end) {
  const HostPrimitives& p = *partition.host;
  const References own = all.subspan(begin, end - begin);
  Bounds3d box;
  double area = 0;
  Vec3d normal;
  float boundary = 0;
  for (const std::uint32_t i : own) {
    box.add(box_of(p, i));
    area += static_cast<double>(p.box_lo[i].w);
    normal = normal + xyz(p.area_normal[i]);
    boundary += p.area_normal[i].w;
  }
  PartitionNode node{.begin = begin, .end = end, .objects = objects_of(p, own)};
  for (int axis = 0; axis < 3; ++axis) {
    node.sums.lo[axis] = static_cast<float>(box.lo[axis]);
    node.sums.hi[axis] = static_cast<float>(box.hi[axis]);
    node.sums.area_normal[axis] = static_cast<float>(normal[axis]);
  }
  node.sums.area = static_cast<float>(area);
  node.sums.count = end - begin;
  node.sums.boundary = boundary;
  if (!partition.cones) return node;
  double least = 1;
  const Vec3d mean = normalized(normal);
  for (const std::uint32_t i : own) {
    const Vec3d n = xyz(p.area_normal[i]);
    if (length(n) > 0) least = std::min(least, dot(n, mean) / length(n));
  }
  node.cone_cosine = static_cast<float>(least);
  return node;
}

struct Plane {
  int axis = 0;
  double position = 0;
  bool has_below(const HostPrimitives& p, std::uint32_t i) const {
    return box_of(p, i).center()[axis] < position;
  }
};

Plane middle_plane(const Bounds3d& box) {
  const Vec3d e = box.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  return {axis, box.center()[axis]};
}

/// Part of a node's primitives: S(b) A(b) of equation 1.
struct Part {
  Bounds3d box;
  double area = 0;
  bool empty() const { return box.empty(); }
  void add(const Part& other) {
    if (other.empty()) return;
    box.add(other.box);
    area += other.area;
  }
  double cost() const { return box.surface_area() * area; }
};

/// The plane of least C(b, c), equation 1; none where every candidate leaves a side empty.
std::optional<Plane> cheapest_plane(const HostPrimitives& p, References references, const Bounds3d& box) {
  std::optional<Plane> best;
  double least = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    std::array<double, kPlanes> planes{};
    for (int k = 0; k < kPlanes; ++k)
      planes[static_cast<std::size_t>(k)] = box.lo[axis] + box.extent()[axis] * (k + 1) / (kPlanes + 1);
    // Part k lies between planes k - 1 and k.
    std::array<Part, kPlanes + 1> parts;
    for (const std::uint32_t i : references) {
      const Bounds3d own = box_of(p, i);
      const auto above = std::upper_bound(planes.begin(), planes.end(), own.center()[axis]);
      parts[static_cast<std::size_t>(above - planes.begin())].add({own, static_cast<double>(p.box_lo[i].w)});
    }
    for (std::size_t k = 0; k < kPlanes; ++k) {
      Part below, above;
      for (std::size_t j = 0; j <= k; ++j) below.add(parts[j]);
      for (std::size_t j = k + 1; j <= kPlanes; ++j) above.add(parts[j]);
      if (below.empty() || above.empty() || !(below.cost() + above.cost() < least)) continue;
      least = below.cost() + above.cost();
      best = Plane{axis, planes[k]};
    }
  }
  return best;
}

/// Moves the references that go left to the front, keeping the order; returns their number.
std::uint32_t split_by(References references, const GoesLeft& goes_left) {
  return static_cast<std::uint32_t>(std::stable_partition(references.begin(), references.end(), goes_left) -
                                    references.begin());
}

/// Tries, until neither side is empty: by object where there are exactly two; as requested; the partition's
/// rule; the spatial median; halves.
std::uint32_t split_in_two(const Partition& partition, References references, const PartitionNode& node,
                           const SplitRequest& request) {
  const HostPrimitives& p = *partition.host;
  if (request.by == SplitBy::kFirst) return request.first;
  const auto count = static_cast<std::uint32_t>(references.size());
  const Bounds3f own = node.bounds();
  const Bounds3d box = to_double(own);
  std::vector<GoesLeft> ways;
  if (node.objects.count == 2) {
    const std::uint32_t first = std::min(node.objects.ids[0], node.objects.ids[1]);
    ways.push_back([&p, first](std::uint32_t i) { return p.objects[i] == first; });
  } else {
    if (request.by == SplitBy::kFacing) {
      ways.push_back([&p, &request](std::uint32_t i) {
        const Vec3d n = xyz(p.area_normal[i]);
        return dot(n, Vec3d(request.direction)) >= static_cast<double>(request.position) * length(n);
      });
    } else if (request.by == SplitBy::kHeight) {
      ways.push_back([&p, &request](std::uint32_t i) {
        return dot(xyz(p.box_lo[i]) + xyz(p.box_hi[i]), Vec3d(request.direction)) <
               2 * static_cast<double>(request.position);
      });
    } else if (request.by == SplitBy::kBoundary) {
      ways.push_back([&p](std::uint32_t i) { return p.area_normal[i].w != 0; });
    } else if (partition.rule == SplitRule::kSurfaceArea) {
      if (const std::optional<Plane> plane = cheapest_plane(p, references, box))
        ways.push_back([&p, plane](std::uint32_t i) { return plane->has_below(p, i); });
    }
    const Plane middle = middle_plane(box);
    ways.push_back([&p, middle](std::uint32_t i) { return middle.has_below(p, i); });
  }
  for (const GoesLeft& way : ways) {
    const std::uint32_t left = split_by(references, way);
    if (left != 0 && left != count) return left;
  }
  return count / 2;
}

void split_node(Partition& partition, References all, const SplitRequest& request) {
  const std::uint32_t n = request.node;
  const PartitionNode node = partition.nodes[n];
  const std::uint32_t left = split_in_two(partition, all.subspan(node.begin, node.count()), node, request);
  partition.nodes[n].left = static_cast<std::int32_t>(partition.nodes.size());
  partition.nodes.push_back(make_node(partition, all, node.begin, node.begin + left));
  partition.nodes.push_back(make_node(partition, all, node.begin + left, node.end));
}

}  // namespace

Partition make_root_on_host(const Primitives& primitives, bool cones, SplitRule rule) {
  std::vector<std::uint32_t> references(primitives.count);
  std::iota(references.begin(), references.end(), 0u);
  auto host = std::make_shared<HostPrimitives>();
  host->box_lo = primitives.box_lo.read();
  host->box_hi = primitives.box_hi.read();
  host->area_normal = primitives.area_normal.read();
  if (primitives.has_objects) host->objects = primitives.objects.read();
  Partition partition{.nodes = {},
                      .references = Buffer<std::uint32_t>(primitives.device, references),
                      .cones = cones,
                      .rule = rule,
                      .host = std::move(host)};
  partition.nodes.push_back(make_node(partition, references, 0, primitives.count));
  return partition;
}

void split_nodes_on_host(Partition& partition, std::vector<std::uint32_t> active,
                         const std::function<bool(const PartitionNode&)>& wants_split,
                         const Progress& progress) {
  std::vector<std::uint32_t> references = partition.references.read();
  std::erase_if(active, [&](std::uint32_t n) { return partition.nodes[n].count() < 2; });
  // Breadth-first: children are appended to `active`.
  std::size_t done = 0;
  for (std::size_t k = 0; k < active.size(); ++k) {
    split_node(partition, references, {active[k]});
    for (const std::int32_t child : {partition.nodes[active[k]].left, partition.nodes[active[k]].left + 1}) {
      const auto c = static_cast<std::uint32_t>(child);
      if (partition.nodes[c].count() > 1 && wants_split(partition.nodes[c]))
        active.push_back(c);
      else
        done += partition.nodes[c].count();
    }
    if (k % 256 == 0)
      report(progress, "partition", static_cast<double>(done) / static_cast<double>(references.size()));
  }
  partition.references.write(std::span<const std::uint32_t>(references));
}

void split_once_on_host(Partition& partition, const std::vector<SplitRequest>& requests) {
  std::vector<std::uint32_t> references = partition.references.read();
  for (const SplitRequest& request : requests) split_node(partition, references, request);
  partition.references.write(std::span<const std::uint32_t>(references));
}

}  // namespace rbvh
