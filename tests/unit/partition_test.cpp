#include "pipeline/rbvh/partition.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "pipeline/rbvh/build.h"
#include "tests/property.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

Scan soup(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> at(-1, 1);
  Scan scan;
  for (std::size_t i = 0; i < 3 * count; ++i) scan.positions.push_back({at(random), at(random), at(random)});
  for (std::uint32_t i = 0; i < count; ++i) scan.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  return scan;
}

/// The leaves hold every primitive once; a node's range is its children's; its sums are right.
void check(const Partition& partition, const Primitives& primitives) {
  const std::vector<std::uint32_t> references = partition.references.read();
  EXPECT_EQ(std::set(references.begin(), references.end()).size(), primitives.count);
  const std::vector<Float4> lo = primitives.box_lo.read(), hi = primitives.box_hi.read();
  for (const PartitionNode& node : partition.nodes) {
    ASSERT_LT(node.begin, node.end);
    EXPECT_EQ(node.sums.count, node.count());
    Bounds3f box;
    double area = 0;
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      const std::uint32_t j = references[i];
      box.add(Vec3f{lo[j].x, lo[j].y, lo[j].z});
      box.add(Vec3f{hi[j].x, hi[j].y, hi[j].z});
      area += lo[j].w;
    }
    EXPECT_EQ(node.bounds().lo, box.lo);
    EXPECT_EQ(node.bounds().hi, box.hi);
    EXPECT_NEAR(node.sums.area, area, 1e-4 * area + 1e-12);
    if (node.left < 0) continue;
    const PartitionNode &l = partition.nodes[static_cast<std::size_t>(node.left)],
                        &r = partition.nodes[static_cast<std::size_t>(node.left) + 1];
    EXPECT_EQ(l.begin, node.begin);
    EXPECT_EQ(l.end, r.begin);
    EXPECT_EQ(r.end, node.end);
  }
}

TEST(Partition, HoldsEveryPrimitiveOnce) {
  const Device device = Device::open();
  for (const std::size_t count : {1u, 2u, 3u, 5000u}) {
    const Primitives primitives = upload_primitives(device, soup(count, property_seed() + count));
    Partition partition = make_root(primitives, true);
    split_nodes(partition, primitives, {0}, [](const PartitionNode& node) { return node.count() > 3; });
    check(partition, primitives);
    for (const PartitionNode& node : partition.nodes)
      EXPECT_TRUE(node.left >= 0 || node.count() <= 3 || count < 2);
  }
}

TEST(Partition, SplitsByCountWhatShareOneCentre) {
  Scan scan;
  for (int i = 0; i < 100; ++i) add_sheet(scan, 1, [](float s, float t) { return Vec3f{s, t, 0}; });
  for (Triangle& t : scan.triangles) t = {0, 1, 2};
  const Primitives primitives = upload_primitives(Device::open(), scan);
  Partition partition = make_root(primitives, false);
  split_nodes(partition, primitives, {0}, [](const PartitionNode&) { return true; });
  check(partition, primitives);
  EXPECT_EQ(partition.nodes.size(), 2 * scan.triangles.size() - 1);
}

TEST(Partition, SplitsAThinSheetByFacing) {
  Scan scan;
  add_plate(scan, 10, 0, true);
  add_plate(scan, 10, -0.001f, false);
  const Primitives primitives = upload_primitives(Device::open(), scan);
  Partition partition = make_root(primitives, false);
  split_once(partition, primitives, {{0, SplitBy::kFacing, {0, 0, 1}}});
  check(partition, primitives);
  ASSERT_EQ(partition.nodes.size(), 3u);
  EXPECT_GT(partition.nodes[1].sums.area_normal[2], 0.99f);
  EXPECT_LT(partition.nodes[2].sums.area_normal[2], -0.99f);
}

TEST(Partition, SplitsOffTheBoundary) {
  // One row of cells around the plate; a closed shape has none, whatever the winding of its triangles.
  Scan plate, octahedron;
  add_plate(plate, 10, 0);
  octahedron.positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  octahedron.triangles = {{0, 2, 4}, {1, 2, 4}, {0, 3, 4}, {3, 1, 4},
                          {5, 0, 2}, {1, 2, 5}, {3, 0, 5}, {1, 3, 5}};
  for (const PartitionWhere where : {PartitionWhere::kDevice, PartitionWhere::kHost}) {
    const Primitives primitives = upload_primitives(Device::open(), plate);
    Partition partition = make_root(primitives, false, SplitRule::kSpatialMedian, where);
    EXPECT_EQ(partition.nodes[0].sums.boundary, 72);
    split_once(partition, primitives, {{0, SplitBy::kBoundary}});
    check(partition, primitives);
    ASSERT_EQ(partition.nodes.size(), 3u);
    EXPECT_EQ(partition.nodes[1].count(), 72u);
    EXPECT_EQ(partition.nodes[1].sums.boundary, 72);
    EXPECT_EQ(partition.nodes[2].sums.boundary, 0);
    EXPECT_EQ(
        make_root(upload_primitives(Device::open(), octahedron), false, SplitRule::kSpatialMedian, where)
            .nodes[0]
            .sums.boundary,
        0);
  }
}

TEST(Partition, ConeOfNormalsIsTheWidest) {
  Scan scan;
  add_sheet(scan, 1, [](float s, float t) { return Vec3f{s, t, 0}; });
  add_sheet(scan, 1, [](float s, float t) { return Vec3f{2 + s, t, s}; });  // 45 degrees
  const Primitives primitives = upload_primitives(Device::open(), scan);
  const Partition partition = make_root(primitives, true);
  // Mean normal of (0,0,1) and (-1,0,1): the flat half leans from it by atan(1/2).
  EXPECT_NEAR(partition.nodes[0].cone_cosine, std::cos(std::atan(0.5f)), 1e-5f);
}

TEST(Partition, NoiseFinerThanTexelsIsNoArea) {
  constexpr int kCells = 120;
  std::mt19937_64 random(property_seed());
  std::normal_distribution<float> noise(0, 0.4f / kCells);
  Scan scan;
  for (const float side : {1.0f, -1.0f})  // a thin sheet's two sides
    add_sheet(scan, kCells, [&](float s, float t) {
      return Vec3f{s, side * t, 0.004f * side + noise(random)};
    });
  // Beside a plate so large that two of the whole's two million texels are some thirty of the sheet's
  // triangles.
  add_sheet(scan, 1, [](float s, float t) { return Vec3f{2 + 40 * s, 40 * t, 0}; });
  const Primitives primitives = upload_primitives(Device::open(), scan);
  const std::vector<Float4> normals = primitives.area_normal.read(), boxes = primitives.box_lo.read();
  double raw = 0, smooth = 0;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const float own = length(Vec3f{normals[i].x, normals[i].y, normals[i].z});
    if (own > 1) continue;  // the plate's
    raw += static_cast<double>(own);
    smooth += static_cast<double>(boxes[i].w);
  }
  EXPECT_GT(raw, 2.4);
  EXPECT_NEAR(smooth, 2, 0.2);
}

/// Equation 1 of a split of these primitives at a plane, from scratch and in double; infinity where one side
/// is empty. The oracle of the device's bins.
double plane_cost(const std::vector<Bounds3f>& boxes, const std::vector<double>& areas, int axis,
                  float position) {
  Bounds3f side[2];
  double area[2] = {0, 0};
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const int s = 0.5f * (boxes[i].lo[axis] + boxes[i].hi[axis]) < position ? 0 : 1;
    side[s].add(boxes[i]);
    area[s] += areas[i];
  }
  if (side[0].empty() || side[1].empty()) return std::numeric_limits<double>::infinity();
  const auto surface = [](const Bounds3f& b) {
    const Vec3d e = Vec3d(b.hi) - Vec3d(b.lo);
    return e.x * e.y + e.y * e.z + e.z * e.x;
  };
  return surface(side[0]) * area[0] + surface(side[1]) * area[1];
}

TEST(Partition, SurfaceAreaSplitsAreTheBestOfTheirCandidates) {
  for (const std::size_t count : {2u, 3u, 40u, 3000u}) {
    const Primitives primitives = upload_primitives(Device::open(), soup(count, property_seed() + count));
    Partition partition = make_root(primitives, false, SplitRule::kSurfaceArea);
    split_nodes(partition, primitives, {0}, [](const PartitionNode& node) { return node.count() > 8; });
    check(partition, primitives);
    const std::vector<std::uint32_t> references = partition.references.read();
    const std::vector<Float4> lo = primitives.box_lo.read(), hi = primitives.box_hi.read();
    for (const PartitionNode& node : partition.nodes) {
      if (node.left < 0) continue;
      std::vector<Bounds3f> boxes;
      std::vector<double> areas;
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const std::uint32_t j = references[i];
        boxes.push_back({{lo[j].x, lo[j].y, lo[j].z}, {hi[j].x, hi[j].y, hi[j].z}});
        areas.push_back(static_cast<double>(lo[j].w));
      }
      double best = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; ++axis)
        for (int plane = 1; plane <= 32; ++plane)
          best = std::min(best, plane_cost(boxes, areas, axis,
                                           node.bounds().lo[axis] + node.bounds().extent()[axis] *
                                                                        (static_cast<float>(plane) / 33)));
      if (std::isinf(best)) continue;  // split in another way
      double cost = 0;
      for (const std::int32_t child : {node.left, node.left + 1}) {
        const PartitionNode& c = partition.nodes[static_cast<std::size_t>(child)];
        const Vec3d e = Vec3d(c.bounds().extent());
        cost += (e.x * e.y + e.y * e.z + e.z * e.x) * static_cast<double>(c.sums.area);
      }
      // A centre on a plane may fall to either side by rounding.
      EXPECT_LE(cost, best * (node.count() > 100 ? 1.001 : 1.05)) << node.count();
    }
  }
}

TEST(Partition, WhatBelongsToTwoObjectsIsSplitByThem) {
  Scan scan;
  add_plate(scan, 6, 0);
  add_plate(scan, 6, 0.01f);
  scan.object_ids.assign(scan.triangles.size(), 7);
  std::fill(scan.object_ids.begin() + 72, scan.object_ids.end(), -3);
  const Primitives primitives = upload_primitives(Device::open(), scan);
  EXPECT_TRUE(primitives.has_objects);
  for (const SplitRule rule : {SplitRule::kSpatialMedian, SplitRule::kSurfaceArea}) {
    Partition partition = make_root(primitives, false, rule);
    EXPECT_EQ(partition.nodes[0].objects.count, 2u);
    split_nodes(partition, primitives, {0}, [](const PartitionNode& node) { return node.count() > 10; });
    check(partition, primitives);
    const std::vector<std::uint32_t> references = partition.references.read(),
                                     objects = primitives.objects.read();
    EXPECT_EQ(partition.nodes[1].count(), 72u);
    for (std::size_t n = 1; n < partition.nodes.size(); ++n) {
      const PartitionNode& node = partition.nodes[n];
      EXPECT_EQ(node.objects.count, 1u);
      for (std::uint32_t i = node.begin; i < node.end; ++i)
        EXPECT_EQ(objects[references[i]], node.objects.ids[0]);
    }
  }
}

TEST(Partition, LeavesOfABuildKnowTheirObject) {
  Scan scan;
  add_plate(scan, 30, 0);
  add_plate(scan, 30, 0.01f);
  scan.object_ids.assign(scan.triangles.size(), 1);
  std::fill(scan.object_ids.begin() + 1800, scan.object_ids.end(), 2);
  BuildConfig config;
  config.levels = by_density({standard_levels().back()});
  const Level level = std::move(build_rbvh(Device::open(), scan, config).levels[0]);
  std::set<std::uint32_t> objects;
  std::uint32_t primitives = 0;
  for (const RbvhLeaf& leaf : level.leaves) {
    objects.insert(leaf.object_id);
    primitives += leaf.primitives;
  }
  EXPECT_EQ(objects, (std::set<std::uint32_t>{1, 2}));
  EXPECT_EQ(primitives, 3600u) << "no leaf has both";
}

TEST(Partition, ThreeObjectsAreCountedAndSplitAsAny) {
  Scan scan;
  for (int k = 0; k < 3; ++k)
    add_sheet(scan, 20, [k](float s, float t) { return Vec3f{s + static_cast<float>(k), t, 0}; });
  for (std::size_t i = 0; i < scan.triangles.size(); ++i)
    scan.object_ids.push_back(static_cast<std::int32_t>(i / 800));
  const Primitives primitives = upload_primitives(Device::open(), scan);
  Partition partition = make_root(primitives, false);
  EXPECT_EQ(partition.nodes[0].objects.count, 3u);
  split_nodes(partition, primitives, {0}, [](const PartitionNode& node) { return node.objects.count > 1; });
  check(partition, primitives);
  for (const PartitionNode& node : partition.nodes) EXPECT_TRUE(node.left >= 0 || node.objects.count == 1);
  // One cut through the middle object, then two nodes of two objects each.
  EXPECT_EQ(partition.nodes.size(), 7u);
}

}  // namespace
}  // namespace rbvh
