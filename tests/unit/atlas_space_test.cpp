// Tiles of an atlas that come and go.
#include "pipeline/rbvh/atlas_space.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/property.h"

namespace rbvh {
namespace {

void expect_apart(const std::vector<LayerTile>& tiles, AtlasSize size) {
  std::vector<int> taken(std::size_t{size.width} * size.height);
  for (const LayerTile& t : tiles) {
    ASSERT_LE(std::uint32_t{t.x} + t.width, size.width);
    ASSERT_LE(std::uint32_t{t.y} + t.height, size.height);
    for (std::size_t y = t.y; y < std::size_t{t.y} + t.height; ++y)
      for (std::size_t x = t.x; x < std::size_t{t.x} + t.width; ++x)
        ASSERT_EQ(taken[y * size.width + x]++, 0);
  }
}

TEST(AtlasSpace, WhatGoesIsTakenAgain) {
  std::mt19937_64 random(property_seed());
  std::uniform_int_distribution<int> side(2, 40), pick(0, 199);
  const auto tile = [&] {
    return LayerTile{0, 0, static_cast<std::uint16_t>(side(random)),
                     static_cast<std::uint16_t>(side(random))};
  };
  std::vector<LayerTile> tiles(200);
  for (LayerTile& t : tiles) t = tile();
  AtlasSize size = place_tiles(tiles, std::vector<std::uint8_t>(200, 0), {2, 2});
  for (int round = 0; round < 200; ++round) {
    const std::vector<LayerTile> before = tiles;
    const AtlasSize size_before = size;
    std::vector<std::uint8_t> has_place(200, 1);
    for (int k = 0; k < 10; ++k) {
      const auto at = static_cast<std::size_t>(pick(random));
      has_place[at] = 0;
      tiles[at] = tile();
    }
    size = place_tiles(tiles, has_place, size);
    expect_apart(tiles, size);
    std::uint64_t used = 0;
    for (const LayerTile& t : tiles) used += std::uint64_t{t.width} * t.height;
    EXPECT_LE(std::uint64_t{size.width} * size.height, used * 3 / 2 + 64 * 64) << round;
    if (size.width != size_before.width || size.height < size_before.height) continue;  // all are placed anew
    bool is_in_place = true;
    for (std::size_t i = 0; i < tiles.size(); ++i)
      is_in_place =
          is_in_place && (has_place[i] == 0 || (tiles[i].x == before[i].x && tiles[i].y == before[i].y));
    EXPECT_TRUE(is_in_place) << round;
  }
}

TEST(AtlasSpace, OfNoTilesItStays) {
  const AtlasSize size = place_tiles({}, {}, {2, 2});
  EXPECT_GE(size.width, 2u);
  EXPECT_GE(size.height, 2u);
}

}  // namespace
}  // namespace rbvh
