// Each decision of a build at and beside its thresholds, and why it is there.
#include "pipeline/rbvh/leaf_policy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace rbvh {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kAnySize = kInfinity;

/// A node of 100 triangles and 400 texels, flat.
constexpr NodeFacts kNode{.primitives = 100, .objects = 1, .area = 4, .projected_area = 4, .cone_cosine = 1};
constexpr LeafQuality kQuality{
    .rho = 1e6f, .texels_per_area = 100, .alpha = 0.8f, .phi_degrees = 60, .farthest_rho = 1e6f};

bool splits(const NodeFacts& node, const LeafQuality& quality = kQuality,
            Refinement refinement = Refinement::kProjectedArea) {
  return wants_split(node, quality, refinement, kAnySize);
}

TEST(LeafPolicy, FlatNodesAreLeaves) { EXPECT_FALSE(splits(kNode)); }

TEST(LeafPolicy, CurvedNodesAreSplitByProjectedArea) {
  // Section 3.1 of the paper: less than alpha of the area is left in the projection.
  NodeFacts node = kNode;
  node.projected_area = 0.8f * 4;
  EXPECT_FALSE(splits(node));
  node.projected_area = 0.79f * 4;
  EXPECT_TRUE(splits(node));
}

TEST(LeafPolicy, CurvedNodesAreSplitByTheirConeOfNormals) {
  NodeFacts node = kNode;
  node.projected_area = 0.1f * 4;  // this refinement ignores it
  node.cone_cosine = 0.51f;        // 59 degrees
  EXPECT_FALSE(splits(node, kQuality, Refinement::kConeOfNormals));
  node.cone_cosine = 0.49f;
  EXPECT_TRUE(splits(node, kQuality, Refinement::kConeOfNormals));
}

TEST(LeafPolicy, SmallNodesAreNotSplitForTheirShape) {
  // Noise is curved at every size and would be split for ever.
  NodeFacts node = kNode;
  node.projected_area = 0;
  node.primitives = 5;
  EXPECT_TRUE(splits(node));
  node.primitives = 4;
  EXPECT_FALSE(splits(node));
  node.primitives = 100;
  LeafQuality quality = kQuality;
  quality.texels_per_area = 4.1f;  // 16.4 texels
  EXPECT_TRUE(splits(node, quality));
  quality.texels_per_area = 4;
  EXPECT_FALSE(splits(node, quality));
}

TEST(LeafPolicy, TwoObjectsAreSplitApartHoweverSmall) {
  // One tile would fuse them.
  NodeFacts node = kNode;
  node.primitives = 2;
  node.objects = 2;
  EXPECT_TRUE(splits(node));
}

TEST(LeafPolicy, LargeTilesAreSplit) {
  // Rays march through them for too long: section 3.4 of the paper. R = sqrt(rho A^2 / projected area).
  EXPECT_FLOAT_EQ(tile_resolution(kNode, 100), 20);
  EXPECT_FALSE(wants_split(kNode, kQuality, Refinement::kProjectedArea, 20));
  EXPECT_TRUE(wants_split(kNode, kQuality, Refinement::kProjectedArea, 19.9f));
  NodeFacts folded = kNode;
  folded.projected_area = 2;
  EXPECT_FLOAT_EQ(tile_resolution(folded, 100), 20 * std::sqrt(2.0f));
  folded.projected_area = 0.01f;
  EXPECT_FLOAT_EQ(tile_resolution(folded, 100), 20 * std::sqrt(2.0f)) << "folded noise has no endless tile";
}

TEST(LeafPolicy, TheBestSideOfATileDependsOnTheRays) {
  EXPECT_NEAR(optimal_resolution(2e6f, RaysKind::kCoherent), 5.76 * std::log(2e6) - 42.99, 1e-3);
  EXPECT_NEAR(optimal_resolution(2e6f, RaysKind::kIncoherent), 1.23 * std::log(2e6) - 0.17, 1e-3);
  EXPECT_EQ(optimal_resolution(100, RaysKind::kCoherent), 8) << "the fit is negative for few texels";
}

TEST(LeafPolicy, NodesThatSpanTooDifferentDensitiesAreSplit) {
  // A leaf has one texel size; with a focus its near and its far end need different ones.
  LeafQuality quality = kQuality;
  quality.farthest_rho = 1e6f / 4;
  EXPECT_FALSE(splits(kNode, quality));
  quality.farthest_rho = 1e6f / 4.1f;
  EXPECT_TRUE(splits(kNode, quality));
}

TEST(LeafPolicy, TilesOfAMeshThatMissTheErrorGiveWay) {
  const LevelFacts level{.error = 1e-5f};
  EXPECT_TRUE(gives_up_tiles(Hybrid::kAuto, level, 1.1e-5f));
  EXPECT_FALSE(gives_up_tiles(Hybrid::kAuto, level, 1e-5f));
  EXPECT_FALSE(gives_up_tiles(Hybrid::kOff, level, 1));
  EXPECT_FALSE(gives_up_tiles(Hybrid::kAuto, {.is_cloud = true, .error = 1e-5f}, 1)) << "its noise counts";
  EXPECT_FALSE(gives_up_tiles(Hybrid::kAuto, {.error = 0}, 1)) << "the density alone decides";
}

TEST(LeafPolicy, CloudsHaveNoMoreTexelsThanTheirPointsAreWorth) {
  EXPECT_FLOAT_EQ(cloud_rho(2e6f, 10000000), 2e6f);
  EXPECT_FLOAT_EQ(cloud_rho(2e6f, 1000), 1450);
  EXPECT_FLOAT_EQ(cloud_rho(1e6f, 1000), 725) << "the levels stay as far apart as they are";
  EXPECT_FLOAT_EQ(cloud_rho(32e6f, 1000), 1450) << "finer than Q0: no more than its points are worth";
  EXPECT_FLOAT_EQ(cloud_rho(32e6f, 1000000), 1.45e6f);
}

TEST(LeafPolicy, MeshesAreNoisyWhereNoiseAddsATenthToTheArea) {
  EXPECT_FALSE(is_noisy_mesh(1.09, 1));
  EXPECT_TRUE(is_noisy_mesh(1.11, 1));
}

TEST(LeafPolicy, BoundaryPrimitivesAreKeptOutOfTiles) {
  // Tiles end at whole texels: a tile's border would close holes of two texels.
  const BoundaryFacts scan{.boundary = 100, .primitives = 1000, .texels = 2000};
  EXPECT_TRUE(separates_boundary(Hybrid::kAuto, scan));
  EXPECT_FALSE(separates_boundary(Hybrid::kOff, scan));
  EXPECT_FALSE(separates_boundary(Hybrid::kAlways, scan));
  EXPECT_FALSE(separates_boundary(Hybrid::kAuto, {0, 1000, 2000})) << "a closed surface has none";
  // In a soup of pieces every edge is a boundary: everything would fall back.
  EXPECT_TRUE(separates_boundary(Hybrid::kAuto, {249, 1000, 2000}));
  EXPECT_FALSE(separates_boundary(Hybrid::kAuto, {250, 1000, 2000}));
  // Levels coarser than the triangles have fewer bytes than these.
  EXPECT_TRUE(separates_boundary(Hybrid::kAuto, {100, 1000, 501}));
  EXPECT_FALSE(separates_boundary(Hybrid::kAuto, {100, 1000, 500}));
}

TEST(LeafPolicy, OnlyMixedLeavesAreSplitAtTheBoundary) {
  EXPECT_FALSE(has_mixed_boundary(0, 10));
  EXPECT_TRUE(has_mixed_boundary(1, 10));
  EXPECT_TRUE(has_mixed_boundary(9, 10));
  EXPECT_FALSE(has_mixed_boundary(10, 10));
}

TEST(LeafPolicy, FaultLimitsAllowForNoise) {
  const FaultLimits clean = fault_limits({});
  EXPECT_EQ(clean.layer_gap, 2);
  EXPECT_EQ(clean.step_limit, 2);
  // A noisy mesh: the slopes of single triangles are noise, only large steps count.
  const FaultLimits noisy = fault_limits({.is_noisy = true});
  EXPECT_EQ(noisy.step_limit, 8);
  EXPECT_EQ(noisy.miss_limit, 8);
  EXPECT_EQ(noisy.steep_area, kInfinity);
  EXPECT_EQ(noisy.layer_gap, clean.layer_gap);
  // A cloud: what lies within its noise is one surface.
  EXPECT_EQ(fault_limits({.is_cloud = true, .thickness = 5}).step_limit, 5);
  EXPECT_EQ(fault_limits({.is_cloud = true, .thickness = 5}).layer_gap, 5);
  EXPECT_EQ(fault_limits({.is_cloud = true, .thickness = 1}).step_limit, clean.step_limit);
}

TileFaults counts(std::uint32_t layered = 0, std::uint32_t steps = 0, std::uint32_t backs = 0,
                  std::uint32_t steep = 0, std::uint32_t misses = 0) {
  return {layered, steps, backs, steep, misses};
}

TEST(LeafPolicy, FlawsAreCountsBeyondTheLimits) {
  EXPECT_FALSE(find_flaws(counts(), {}).any());
  EXPECT_TRUE(find_flaws(counts(1), {}).is_uneven);
  EXPECT_TRUE(find_flaws(counts(0, 1), {}).is_uneven);
  EXPECT_TRUE(find_flaws(counts(0, 0, 0, 0, 1), {}).is_uneven);
  EXPECT_TRUE(find_flaws(counts(0, 0, 1), {}).has_back);
  // In sixteenths of a texel: a few texels of steep slivers are not worth a split.
  EXPECT_FALSE(find_flaws(counts(0, 0, 0, 64), {}).any());
  EXPECT_TRUE(find_flaws(counts(0, 0, 0, 65), {}).is_steep);
  EXPECT_FALSE(find_flaws(counts(0, 0, 0, 4000000000u), fault_limits({.is_noisy = true})).any());
}

LeafDecision decide(const TileFacts& tile, Hybrid hybrid = Hybrid::kAuto) {
  return decide_leaf(tile, hybrid);
}

TEST(LeafPolicy, GoodTilesAreRasterized) {
  EXPECT_EQ(decide({.primitives = 1000, .texels = 400, .surface_texels = 300}), LeafDecision::kRasterize);
}

TEST(LeafPolicy, LeavesFallBackWherePrimitivesAreFewerBytes) {
  // 11 texels take as many bytes as a primitive.
  EXPECT_EQ(decide({.primitives = 10, .texels = 109}), LeafDecision::kRasterize);
  EXPECT_EQ(decide({.primitives = 10, .texels = 110}), LeafDecision::kPrimitives);
  EXPECT_EQ(decide({.primitives = 10, .texels = 110}, Hybrid::kOff), LeafDecision::kRasterize);
  // Up to 64: more are slower to intersect than any tile is to march.
  EXPECT_EQ(decide({.primitives = 64, .texels = 10000}), LeafDecision::kPrimitives);
  EXPECT_EQ(decide({.primitives = 65, .texels = 10000}), LeafDecision::kRasterize);
}

TEST(LeafPolicy, FaultyTilesFallBackOrAreSplit) {
  const auto faulty = [](std::uint32_t primitives, float surface_texels = 100) {
    return TileFacts{
        .primitives = primitives, .texels = 100, .surface_texels = surface_texels, .is_faulty = true};
  };
  EXPECT_EQ(decide(faulty(32)), LeafDecision::kPrimitives);
  EXPECT_EQ(decide(faulty(33)), LeafDecision::kSplit) << "too many to store for one fault";
  EXPECT_EQ(decide(faulty(32), Hybrid::kOff), LeafDecision::kSplit);
  EXPECT_EQ(decide(faulty(1), Hybrid::kOff), LeafDecision::kRasterize) << "there is nothing to split";
  // Below the size of a few texels a fault is not seen, and noise would be split for ever.
  EXPECT_EQ(decide(faulty(33, 4.1f)), LeafDecision::kSplit);
  EXPECT_EQ(decide(faulty(33, 4)), LeafDecision::kRasterize);
}

TEST(LeafPolicy, AlwaysSplitsUntilAllFallBack) {
  EXPECT_EQ(decide({.primitives = 64, .texels = 4}, Hybrid::kAlways), LeafDecision::kPrimitives);
  EXPECT_EQ(decide({.primitives = 65, .texels = 4}, Hybrid::kAlways), LeafDecision::kSplit);
}

TEST(LeafPolicy, UncoveredTrianglesAreExactWhereTheyAreTogether) {
  // Scattered over a tile, one leaf of them would have a box as large as the tile's.
  const auto group = [](std::uint32_t primitives, std::uint32_t texels) {
    return TileFacts{.primitives = primitives, .texels = texels, .is_uncovered_group = true};
  };
  EXPECT_EQ(decide(group(2, 128)), LeafDecision::kPrimitives);
  EXPECT_EQ(decide(group(2, 129)), LeafDecision::kSplit);
  EXPECT_EQ(decide(group(1, 100000)), LeafDecision::kPrimitives) << "a single one cannot be split";
  EXPECT_EQ(decide(group(65, 10)), LeafDecision::kSplit);
}

TEST(LeafPolicy, UncoveredTrianglesAreSplitOffTheirTile) {
  EXPECT_EQ(decide_uncovered(0, 10), LeafDecision::kRasterize);
  EXPECT_EQ(decide_uncovered(1, 10), LeafDecision::kSplit);
  EXPECT_EQ(decide_uncovered(10, 10), LeafDecision::kPrimitives)
      << "all of them: there is nothing to split off";
  EXPECT_EQ(decide_uncovered(65, 65), LeafDecision::kRasterize) << "too many for a leaf";
}

TEST(LeafPolicy, FaultsChooseTheSplit) {
  // Primitives that face away go to a tile of the other side; steep ones to a tile on which they are not.
  EXPECT_EQ(choose_fault_split({.has_back = true, .is_steep = true}).by, SplitBy::kFacing);
  EXPECT_EQ(choose_fault_split({.has_back = true, .is_steep = true}).cosine, 0);
  EXPECT_EQ(choose_fault_split({.is_steep = true}).by, SplitBy::kFacing);
  EXPECT_EQ(choose_fault_split({.is_steep = true}).cosine, RBVH_STEEP_COSINE);
  EXPECT_EQ(choose_fault_split({.is_uneven = true}).by, SplitBy::kRule);
  // A cloud's upper layer goes to a tile of its own: halves of the tile would both have two layers.
  EXPECT_EQ(choose_fault_split({.has_layers = true, .is_uneven = true}).by, SplitBy::kHeight);
  EXPECT_EQ(choose_fault_split({.has_back = true, .has_layers = true}).by, SplitBy::kFacing);
}

TEST(LeafPolicy, ObjectsAreSplitApartBeforeAnythingElse) {
  EXPECT_EQ(split_kind(SplitBy::kRule, 1), RBVH_SPLIT_PLANE);
  EXPECT_EQ(split_kind(SplitBy::kRule, 3), RBVH_SPLIT_PLANE) << "of more than two a plane comes first";
  EXPECT_EQ(split_kind(SplitBy::kFacing, 1), RBVH_SPLIT_FACING);
  EXPECT_EQ(split_kind(SplitBy::kBoundary, 1), RBVH_SPLIT_BOUNDARY);
  for (const SplitBy by : {SplitBy::kRule, SplitBy::kFacing, SplitBy::kBoundary})
    EXPECT_EQ(split_kind(by, 2), RBVH_SPLIT_OBJECT);
  EXPECT_EQ(split_kind(SplitBy::kFirst, 2), RBVH_SPLIT_COUNT) << "the caller has sorted the references";
}

TEST(LeafPolicy, ASplitThatLeavesASideEmptyIsReplaced) {
  EXPECT_EQ(next_split_kind(RBVH_SPLIT_FACING), RBVH_SPLIT_PLANE) << "all face one way";
  EXPECT_EQ(next_split_kind(RBVH_SPLIT_PLANE), RBVH_SPLIT_COUNT) << "all at one point";
  EXPECT_EQ(next_split_kind(RBVH_SPLIT_BOUNDARY), RBVH_SPLIT_COUNT);
}

}  // namespace
}  // namespace rbvh
