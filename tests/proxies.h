// Small proxies for tests.
#pragma once

#include <cmath>

#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/patch_point.h"

namespace rbvh {

/// Two quads side by side in the plane z = 0, with tiles of 5 and of 3 texels a side; both follow one smooth
/// surface, and agree on their common edge.
inline Proxy make_two_patch_proxy() {
  Proxy proxy;
  proxy.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}};
  proxy.quads = {{0, 1, 4, 3}, {1, 2, 5, 4}};
  proxy.tiles = {{0, 0, 5, 0}, {5, 0, 3, 0}};
  proxy.map_width = 8;
  proxy.map_height = 5;
  proxy.map.assign(40, Vec3f{});
  const auto height = [](float x, float y) { return 0.25f * std::sin(2 * x) + 0.125f * y; };
  for (std::size_t patch = 0; patch < 2; ++patch) {
    const std::uint32_t side = proxy.tiles[patch].side;
    for (std::uint32_t j = 0; j < side; ++j)
      for (std::uint32_t i = 0; i < side; ++i) {
        const Vec3f p = base_point(proxy, proxy.quads[patch], side, i, j);
        proxy.map[texel_index(proxy, proxy.tiles[patch], i, j)] = {0.125f * p.y, 0, height(p.x, p.y)};
      }
  }
  // The finer one's edge lies on the coarser one's chords.
  const auto texel = [&](std::uint32_t j) -> Vec3f& { return proxy.map[j * 8 + 4]; };
  for (std::uint32_t j = 1; j < 5; j += 2) texel(j) = mix(texel(j - 1), texel(j + 1), 0.5f);
  measure_displacements(proxy);
  return proxy;
}

}  // namespace rbvh
