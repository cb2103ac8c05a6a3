#include "pipeline/proxy/proxy_surface.h"

#include "pipeline/proxy/patch_point.h"

namespace rbvh {

TriangleSoup surface_of(const Proxy& proxy) {
  TriangleSoup soup;
  std::size_t quads = 0;
  for (const PatchTile& tile : proxy.tiles) quads += std::size_t{tile.side - 1} * (tile.side - 1);
  soup.reserve(quads * 6);
  std::vector<Vec3f> row[2];
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch) {
    const std::uint32_t side = proxy.tiles[patch].side;
    for (std::uint32_t j = 0; j < side; ++j) {
      std::swap(row[0], row[1]);
      row[1].resize(side);
      for (std::uint32_t i = 0; i < side; ++i) row[1][i] = surface_point(proxy, patch, i, j);
      for (std::uint32_t i = 0; j > 0 && i + 1 < side; ++i)
        soup.insert(soup.end(),
                    {row[0][i], row[0][i + 1], row[1][i + 1], row[0][i], row[1][i + 1], row[1][i]});
    }
  }
  return soup;
}

Bounds3f surface_bounds(const Proxy& proxy) {
  Bounds3f box;
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch)
    for (std::uint32_t j = 0; j < proxy.tiles[patch].side; ++j)
      for (std::uint32_t i = 0; i < proxy.tiles[patch].side; ++i) box.add(surface_point(proxy, patch, i, j));
  return box;
}

}  // namespace rbvh
