// Where a patch's texels lie on its base quad and on its surface. Sums are in an order that gives two patches
// the same bits along the edge that they share, whatever direction each of them has.
#pragma once

#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// Most texels a side: 2^12 + 1.
inline constexpr std::uint32_t kMaxPatchSide = 4097;

/// a at s = 0, b at s = 1; mix(a, b, s) has the bits of mix(b, a, 1 - s) where s is i / 2^k.
inline Vec3f mix(Vec3f a, Vec3f b, float s) { return a * (1 - s) + b * s; }

/// The base quad's point under texel (i, j) of `side` texels a side.
inline Vec3f base_point(const Proxy& proxy, const Quad& quad, std::uint32_t side, std::uint32_t i,
                        std::uint32_t j) {
  const float step = 1 / static_cast<float>(side - 1);
  const float s = static_cast<float>(i) * step, t = static_cast<float>(j) * step;
  const auto corner = [&](std::size_t k) { return proxy.positions[quad[k]]; };
  return mix(mix(corner(0), corner(1), s), mix(corner(3), corner(2), s), t);
}

inline std::size_t texel_index(const Proxy& proxy, const PatchTile& tile, std::uint32_t i, std::uint32_t j) {
  return std::size_t{tile.y + j} * proxy.map_width + tile.x + i;
}

/// The displaced point at texel (i, j).
inline Vec3f surface_point(const Proxy& proxy, std::size_t patch, std::uint32_t i, std::uint32_t j) {
  const PatchTile& tile = proxy.tiles[patch];
  return base_point(proxy, proxy.quads[patch], tile.side, i, j) + proxy.map[texel_index(proxy, tile, i, j)];
}

/// Texel `k` of `side` along edge `edge` of a tile, from its corner `edge` to the next one.
struct TexelPlace {
  std::uint32_t i, j;
};
inline TexelPlace edge_texel(std::uint32_t side, std::size_t edge, std::uint32_t k) {
  const std::uint32_t last = side - 1;
  switch (edge) {
    case 0:
      return {k, 0};
    case 1:
      return {last, k};
    case 2:
      return {last - k, last};
    default:
      return {0, last - k};
  }
}

}  // namespace rbvh
