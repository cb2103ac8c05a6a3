#include "pipeline/proxy/pack_map.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/proxy/check_proxy.h"

namespace rbvh {

void pack_map(Proxy& proxy) {
  std::uint64_t texels = 0;
  std::uint32_t largest = 0;
  for (const PatchTile& tile : proxy.tiles) {
    texels += std::uint64_t{tile.side} * tile.side;
    largest = std::max(largest, tile.side);
  }
  // A power of two: texel centres are then exact in texture coordinates.
  const auto root = static_cast<std::uint64_t>(std::sqrt(static_cast<double>(texels)));
  const std::uint64_t width = std::bit_ceil(std::max<std::uint64_t>(root, largest));
  std::vector<std::uint32_t> order(proxy.tiles.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return proxy.tiles[a].side > proxy.tiles[b].side;
  });
  std::uint64_t x = 0, y = 0, row = 0;
  for (const std::uint32_t i : order) {
    PatchTile& tile = proxy.tiles[i];
    if (x + tile.side > width) {
      x = 0;
      y += row;
    }
    if (x == 0) row = tile.side;
    if (y + row > kMaxMapSide || width > kMaxMapSide)
      throw Error(ErrorKind::kBudget, "",
                  "the map would be over 65536 texels a side; ask for fewer patches or texels");
    tile.x = static_cast<std::uint32_t>(x);
    tile.y = static_cast<std::uint32_t>(y);
    x += tile.side;
  }
  proxy.map_width = static_cast<std::uint32_t>(width);
  proxy.map_height = static_cast<std::uint32_t>(y + row);
  proxy.map.assign(std::size_t{proxy.map_width} * proxy.map_height, Vec3f{});
}

}  // namespace rbvh
