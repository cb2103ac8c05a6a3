#include "pipeline/rbvh/partition.h"

#include <gtest/gtest.h>

#include <set>

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
  split_once(partition, primitives, {{0, true, {0, 0, 1}}});
  check(partition, primitives);
  ASSERT_EQ(partition.nodes.size(), 3u);
  EXPECT_GT(partition.nodes[1].sums.area_normal[2], 0.99f);
  EXPECT_LT(partition.nodes[2].sums.area_normal[2], -0.99f);
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

}  // namespace
}  // namespace rbvh
