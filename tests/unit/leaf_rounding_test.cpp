// Frames and boxes of leaves as files have them.
#include "pipeline/rbvh/leaf_rounding.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/rbvh/texel.h"
#include "tests/format/random_level.h"
#include "tests/property.h"

namespace rbvh {
namespace {

TEST(LeafRounding, FramesMoveLittleAndOnlyOnce) {
  Random random(property_seed());
  const LeafGrid grid = leaf_grid({{-1, -2, -3}, {3, 2, 1}});
  for (int trial = 0; trial < 2000; ++trial) {
    const RbvhLeaf leaf = random_tile(random, {}, trial % 2 == 0);
    RbvhLeaf rounded{}, twice{};
    unround_frame(grid, round_frame(grid, leaf.to_tile), rounded.to_tile);
    unround_frame(grid, round_frame(grid, rounded.to_tile), twice.to_tile);
    for (int i = 0; i < 12; ++i) EXPECT_EQ(rounded.to_tile[i], twice.to_tile[i]) << trial << " " << i;
    const TileFrame a(leaf), b(rounded);
    const double side = length(a.u);
    for (const double x : {0.0, 60.0})
      for (const double y : {0.0, 60.0}) {
        const auto at = [&](const TileFrame& f) { return f.origin + f.u * x + f.v * y; };
        EXPECT_LT(length(at(a) - at(b)), 0.01 * side + 2 * static_cast<double>(grid.frame_step)) << trial;
      }
  }
}

TEST(LeafRounding, TexelSidesGrowByLessThanHalfAPercent) {
  Random random(property_seed());
  for (int trial = 0; trial < 1000; ++trial) {
    const double side = std::exp(static_cast<double>(uniform(random, -30, 30)));
    const double rounded = round_texel(side);
    EXPECT_GE(rounded, side * (1 - 1e-7));
    EXPECT_LE(rounded, side * 1.005);
    EXPECT_EQ(round_texel(rounded), rounded);
  }
}

TEST(LeafRounding, BoxesContainWhatTheyRound) {
  Random random(property_seed());
  const Bounds3f bounds{{100, 200, 300}, {101, 203, 302}};
  const LeafGrid grid = leaf_grid(bounds);
  for (int trial = 0; trial < 1000; ++trial) {
    Bounds3f box;
    for (int corner = 0; corner < 2; ++corner)
      box.add(Vec3f{uniform(random, 100, 101), uniform(random, 200, 203), uniform(random, 300, 302)});
    const Bounds3f rounded = unround_box(grid, round_box(grid, box)),
                   twice = unround_box(grid, round_box(grid, rounded));
    EXPECT_EQ(rounded.lo, twice.lo);
    EXPECT_EQ(rounded.hi, twice.hi);
    for (int axis = 0; axis < 3; ++axis) {
      const float room = 1.1f * grid.box_step;
      EXPECT_LE(rounded.lo[axis], box.lo[axis] + 0.02f * grid.box_step);
      EXPECT_GE(rounded.hi[axis], box.hi[axis] - 0.02f * grid.box_step);
      EXPECT_GE(rounded.lo[axis], box.lo[axis] - room);
      EXPECT_LE(rounded.hi[axis], box.hi[axis] + room);
    }
  }
}

TEST(LeafRounding, TrianglesTurnOnlyOnce) {
  Random random(property_seed());
  for (int trial = 0; trial < 500; ++trial) {
    Scan mesh;
    mesh.positions.resize(2 + random() % 20);
    for (std::uint64_t count = random() % 100; count > 0; --count) {
      const auto any = [&] { return static_cast<std::uint32_t>(random() % mesh.positions.size()); };
      const Triangle t = {any(), any(), any()};
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) mesh.triangles.push_back(t);
    }
    rotate_as_stored(mesh);
    const std::vector<Triangle> once = mesh.triangles;
    rotate_as_stored(mesh);
    EXPECT_EQ(mesh.triangles, once);
  }
}

TEST(LeafRounding, RadiiNeverShrink) {
  for (const float radius : {0.0f, 1e-20f, 0.3f, 1.0f, 1.00001f, 5e10f}) {
    const float rounded = unround_radius(round_radius(radius));
    EXPECT_GE(rounded, radius);
    EXPECT_LE(rounded, radius * 1.005f);
    EXPECT_EQ(unround_radius(round_radius(rounded)), rounded);
  }
}

}  // namespace
}  // namespace rbvh
