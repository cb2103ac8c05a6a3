#include "pipeline/rbvh/atlas_space.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace rbvh {
namespace {

constexpr std::uint32_t kMostSide = 65535;

struct Rectangle {
  std::uint32_t x = 0, y = 0, width = 0, height = 0;
};

/// The texels that no tile has, as rectangles: runs of rows that are free in the same columns.
std::vector<Rectangle> free_space(std::span<const LayerTile> tiles, std::span<const std::uint8_t> has_place,
                                  AtlasSize size) {
  std::vector<std::uint8_t> is_taken(std::size_t{size.width} * size.height);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (has_place[i] == 0) continue;
    for (std::size_t y = tiles[i].y; y < std::size_t{tiles[i].y} + tiles[i].height; ++y)
      std::fill_n(is_taken.begin() + static_cast<std::ptrdiff_t>(y * size.width + tiles[i].x), tiles[i].width,
                  std::uint8_t{1});
  }
  std::vector<Rectangle> done, open, here;
  for (std::uint32_t y = 0; y < size.height; ++y) {
    const auto row = is_taken.begin() + static_cast<std::ptrdiff_t>(std::size_t{y} * size.width);
    here.clear();
    for (std::uint32_t x = 0; x < size.width;) {
      const auto begin = std::find(row + x, row + size.width, 0), end = std::find(begin, row + size.width, 1);
      if (begin != end)
        here.push_back(
            {static_cast<std::uint32_t>(begin - row), y, static_cast<std::uint32_t>(end - begin), 1});
      x = static_cast<std::uint32_t>(end - row);
    }
    auto above = open.begin();
    for (Rectangle& run : here) {
      while (above != open.end() && above->x < run.x) done.push_back(*above++);
      if (above == open.end() || above->x != run.x) continue;
      if (above->width == run.width)
        run = {run.x, above->y, run.width, above->height + 1};
      else
        done.push_back(*above);
      ++above;
    }
    done.insert(done.end(), above, open.end());
    open.swap(here);
  }
  done.insert(done.end(), open.begin(), open.end());
  return done;
}

/// All of them, wherever they were.
AtlasSize place_anew(std::span<LayerTile> tiles) {
  std::vector<RbvhLeaf> leaves(tiles.size());
  std::vector<RbvhLeaf*> all;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    leaves[i].width = tiles[i].width;
    leaves[i].height = tiles[i].height;
    all.push_back(&leaves[i]);
  }
  const AtlasSize size = pack_tiles(all);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    tiles[i].x = leaves[i].x;
    tiles[i].y = leaves[i].y;
  }
  return size;
}

}  // namespace

AtlasSize place_tiles(std::span<LayerTile> tiles, std::span<const std::uint8_t> has_place, AtlasSize size) {
  std::uint64_t texels = 0;
  std::vector<std::size_t> waiting;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    texels += std::uint64_t{tiles[i].width} * tiles[i].height;
    if (has_place[i] == 0) waiting.push_back(i);
    if (tiles[i].width > size.width) return place_anew(tiles);
  }
  std::stable_sort(waiting.begin(), waiting.end(), [&](std::size_t a, std::size_t b) {
    return tiles[a].height != tiles[b].height ? tiles[a].height > tiles[b].height
                                              : tiles[a].width > tiles[b].width;
  });
  std::vector<Rectangle> free = free_space(tiles, has_place, size);
  for (const std::size_t i : waiting) {
    LayerTile& tile = tiles[i];
    std::size_t best = free.size();
    for (std::size_t k = 0; k < free.size(); ++k) {
      if (free[k].width < tile.width || free[k].height < tile.height) continue;
      // The lowest, then the narrowest: what lies beside the tile stays as high as it can.
      if (best == free.size() || free[k].height < free[best].height ||
          (free[k].height == free[best].height && free[k].width < free[best].width))
        best = k;
    }
    if (best == free.size()) {
      free.push_back({0, size.height, size.width, tile.height});
      size.height += tile.height;
    }
    const Rectangle at = free[best];
    tile.x = static_cast<std::uint16_t>(at.x);
    tile.y = static_cast<std::uint16_t>(at.y);
    if (size.height > kMostSide) return place_anew(tiles);
    free[best] = {at.x + tile.width, at.y, at.width - tile.width, tile.height};
    if (at.height > tile.height)
      free.push_back({at.x, at.y + tile.height, at.width, at.height - tile.height});
  }
  const std::uint64_t all = std::uint64_t{size.width} * size.height;
  return 3 * texels < 2 * all ? place_anew(tiles) : size;
}

}  // namespace rbvh
