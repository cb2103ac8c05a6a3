#include "pipeline/rbvh/tile.h"

#include <gtest/gtest.h>

#include "pipeline/rbvh/pack_atlas.h"
#include "pipeline/rbvh/rasterize.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

struct OneTile {
  Tile tile;
  TileTexels texels;
};

OneTile rasterize_whole(const Scan& scan, float texels) {
  const Primitives primitives = upload_primitives(Device::open(), scan);
  const Partition partition = make_root(primitives, false);
  OneTile one;
  one.tile = rasterize_tiles(
      primitives, partition, {0}, RasterConfig{.rho = texels / partition.nodes[0].sums.area},
      [](const Tile&) { return LeafDecision::kRasterize; }, one.texels)[0];
  return one;
}

/// The point of a texel, by the inverse of the tile's map (its rows are orthogonal).
Vec3d texel_point(const RbvhLeaf& leaf, double u, double v, double w) {
  Vec3d p{};
  const double at[3] = {u, v, w};
  for (int row = 0; row < 3; ++row) {
    const float* m = leaf.to_tile + 4 * row;
    const Vec3d r{m[0], m[1], m[2]};
    p = p + r * ((at[row] - m[3]) / dot(r, r));
  }
  return p;
}

TEST(Tile, HasAHeightForEveryTexelOfASlopeToHalfAQuantum) {
  Scan scan;
  // Bilinear in (s, t) and of more than one plane, so that heights matter.
  add_sheet(scan, 40, [](float s, float t) { return Vec3f{s, t, 0.1f * s + 0.05f * t + 0.02f * s * s}; });
  const OneTile one = rasterize_whole(scan, 2000);
  EXPECT_FALSE(one.tile.flaws.any());
  const RbvhLeaf& leaf = one.tile.leaf;
  const double quantum = 1 / length(Vec3d{leaf.to_tile[8], leaf.to_tile[9], leaf.to_tile[10]});
  int inside = 0;
  for (int y = 0; y < leaf.height; ++y)
    for (int x = 0; x < leaf.width; ++x) {
      const std::uint16_t w = one.texels.heights[static_cast<std::size_t>(y * leaf.width + x)];
      const Vec3d p = texel_point(leaf, x, y, w);
      if (p.x < 0.01 || p.x > 0.99 || p.y < 0.01 || p.y > 0.99) continue;
      ++inside;
      ASSERT_GT(w, 0);
      // The mesh lies within 4e-6 of the curve (chords of 1/40).
      EXPECT_NEAR(p.z, 0.1 * p.x + 0.05 * p.y + 0.02 * p.x * p.x, quantum + 4e-6) << x << " " << y;
    }
  // The rectangle is assumed to be 1.5 times as large as what is covered of it.
  const double expected = 2000 / 1.5 * 0.98 * 0.98;
  EXPECT_NEAR(inside, expected, 0.03 * expected);
}

TEST(Tile, CoversAPlateToItsBoundaryAndNotMuchMore) {
  Scan scan;
  add_plate(scan, 1, 0);
  const OneTile one = rasterize_whole(scan, 100);
  const RbvhLeaf& leaf = one.tile.leaf;
  const double texel = 1 / length(Vec3d{leaf.to_tile[0], leaf.to_tile[1], leaf.to_tile[2]});
  Vec3d lo{9, 9, 9}, hi{-9, -9, -9};
  for (int y = 0; y < leaf.height; ++y)
    for (int x = 0; x < leaf.width; ++x) {
      if (one.texels.heights[static_cast<std::size_t>(y * leaf.width + x)] == 0) continue;
      const Vec3d p = texel_point(leaf, x, y, 1);
      if (std::abs(p.y) < 0.5) lo.x = std::min(lo.x, p.x), hi.x = std::max(hi.x, p.x);
      if (std::abs(p.x) < 0.5) lo.y = std::min(lo.y, p.y), hi.y = std::max(hi.y, p.y);
    }
  for (const double edge : {-lo.x, -lo.y, hi.x, hi.y}) {
    EXPECT_GE(edge, 0.5);
    EXPECT_LE(edge, 0.5 + 0.75 * texel + 1e-6);
  }
}

TEST(Tile, FollowsItsNeighboursPastItsOwnPrimitives) {
  // A roof: the left half is flat, the right half falls off by 45 degrees.
  Scan scan;
  add_sheet(scan, 20, [](float s, float t) { return Vec3f{s, t, s > 0.5f ? 0.5f - s : 0.0f}; });
  const Primitives primitives = upload_primitives(Device::open(), scan);
  Partition partition = make_root(primitives, false);
  split_once(partition, primitives, {{0}});
  TileTexels texels;
  const std::uint32_t flat = partition.nodes[1].bounds().center().x < 0.5f ? 1 : 2;
  const Tile tile = rasterize_tiles(
      primitives, partition, {flat}, RasterConfig{.rho = 1000},
      [](const Tile&) { return LeafDecision::kRasterize; }, texels)[0];
  int past = 0;
  for (int y = 0; y < tile.leaf.height; ++y)
    for (int x = 0; x < tile.leaf.width; ++x) {
      const std::uint16_t w = texels.heights[static_cast<std::size_t>(y * tile.leaf.width + x)];
      const Vec3d p = texel_point(tile.leaf, x, y, w);
      if (w == 0 || p.y < 0 || p.y > 1 || p.x < 0) continue;
      past += p.x > 0.505;
      EXPECT_NEAR(p.z, p.x > 0.5 ? 0.5 - p.x : 0.0, 1e-4) << x << " " << y;
    }
  EXPECT_GT(past, 20);
}

TEST(Tile, FindsTwoLayersStepsAndBackFaces) {
  Scan flat, layers, step, shell;
  add_plate(flat, 8, 0);
  EXPECT_FALSE(rasterize_whole(flat, 400).tile.flaws.any());
  add_plate(layers, 8, 0);
  add_plate(layers, 8, 0.3f);
  EXPECT_TRUE(rasterize_whole(layers, 400).tile.flaws.any());
  EXPECT_FALSE(rasterize_whole(layers, 400).tile.flaws.has_back);
  add_sheet(step, 8, [](float s, float t) { return Vec3f{s, t, 0}; });
  add_sheet(step, 8, [](float s, float t) { return Vec3f{s + 1.001f, t, 1}; });
  EXPECT_TRUE(rasterize_whole(step, 400).tile.flaws.any());
  add_plate(shell, 8, 0);
  add_sheet(shell, 2, [](float s, float t) { return Vec3f{0.2f * t, 0.2f * s, -0.001f}; });
  EXPECT_TRUE(rasterize_whole(shell, 400).tile.flaws.has_back);
}

TEST(Tile, FindsSteepPartsAndMissedCorners) {
  Scan bend;
  add_sheet(bend, 16, [](float s, float t) { return Vec3f{std::min(s, 0.8f), t, std::max(0.0f, s - 0.8f)}; });
  EXPECT_TRUE(rasterize_whole(bend, 400).tile.flaws.is_steep);
  // Between four texels and lower than a step; a quarter as high it is no fault.
  for (const float height : {0.08f, 0.02f}) {
    Scan tent;
    add_sheet(tent, 60, [&](float s, float t) {
      return Vec3f{s, t, std::abs(s - 0.5f) < 0.01f && std::abs(t - 0.5f) < 0.01f ? height : 0};
    });
    EXPECT_EQ(rasterize_whole(tent, 400).tile.flaws.any(), height > 0.05f);
  }
}

TEST(Tile, OfDiscsFollowsTheirPlane) {
  Scan cloud;
  for (int j = 0; j < 30; ++j)
    for (int i = 0; i < 30; ++i) {
      cloud.positions.push_back({static_cast<float>(i), static_cast<float>(j), 0.2f * static_cast<float>(i)});
      cloud.normals.push_back(normalized(Vec3f{-0.2f, 0, 1}));
      cloud.radii.push_back(0.8f);
    }
  const OneTile one = rasterize_whole(cloud, 3000);
  EXPECT_FALSE(one.tile.flaws.any());
  const RbvhLeaf& leaf = one.tile.leaf;
  for (int y = 0; y < leaf.height; ++y)
    for (int x = 0; x < leaf.width; ++x) {
      const std::uint16_t w = one.texels.heights[static_cast<std::size_t>(y * leaf.width + x)];
      const Vec3d p = texel_point(leaf, x, y, w);
      if (p.x < 0 || p.x > 29 || p.y < 0 || p.y > 29) continue;
      ASSERT_GT(w, 0);
      EXPECT_NEAR(p.z, 0.2 * p.x, 1e-3);
    }
}

TEST(Atlas, TilesDoNotOverlap) {
  std::vector<Tile> tiles(300);
  std::vector<RbvhLeaf*> leaves;
  TileTexels texels;
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    tiles[k].leaf.width = static_cast<std::uint16_t>(2 + k * 7 % 31);
    tiles[k].leaf.height = static_cast<std::uint16_t>(2 + k * 13 % 29);
    tiles[k].decision = LeafDecision::kRasterize;
    leaves.push_back(&tiles[k].leaf);
    tiles[k].first_texel = texels.heights.size();
    texels.heights.insert(texels.heights.end(),
                          static_cast<std::size_t>(tiles[k].leaf.width) * tiles[k].leaf.height,
                          static_cast<std::uint16_t>(k + 1));
  }
  const AtlasSize size = pack_tiles(leaves);
  const std::vector<std::uint16_t> atlas = assemble_layer(tiles, texels.heights, size);
  ASSERT_EQ(atlas.size(), static_cast<std::size_t>(size.width) * size.height);
  std::vector<std::size_t> counts(tiles.size() + 1);
  for (const std::uint16_t value : atlas) ++counts[value];
  for (std::size_t k = 0; k < tiles.size(); ++k)
    EXPECT_EQ(counts[k + 1], static_cast<std::size_t>(tiles[k].leaf.width) * tiles[k].leaf.height);
  EXPECT_LT(counts[0], atlas.size() / 4);
}

}  // namespace
}  // namespace rbvh
