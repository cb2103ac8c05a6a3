#include "pipeline/proxy/patch_levels.h"

#include <algorithm>
#include <bit>
#include <tuple>

#include "pipeline/base/error.h"

namespace rbvh {

std::uint32_t tile_level(const PatchTile& tile) {
  RBVH_CHECK(tile.side >= 2 && std::has_single_bit(tile.side - 1));
  return static_cast<std::uint32_t>(std::countr_zero(tile.side - 1));
}

namespace {

using PlaceBits = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>;

PlaceBits bits_of(Vec3f p) {
  // + 0 makes one zero of both.
  return {std::bit_cast<std::uint32_t>(p.x + 0.0f), std::bit_cast<std::uint32_t>(p.y + 0.0f),
          std::bit_cast<std::uint32_t>(p.z + 0.0f)};
}

/// The same number for vertices at the same place.
std::vector<std::uint32_t> place_numbers(const std::vector<Vec3f>& positions) {
  std::vector<std::uint32_t> order(positions.size()), numbers(positions.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return bits_of(positions[a]) < bits_of(positions[b]); });
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && bits_of(positions[order[i]]) != bits_of(positions[order[i - 1]])) ++next;
    numbers[order[i]] = next;
  }
  return numbers;
}

}  // namespace

PatchEdges find_edges(const Proxy& proxy) {
  const std::vector<std::uint32_t> places = place_numbers(proxy.positions);
  struct Border {
    std::uint32_t lo, hi, patch, corner;
  };
  std::vector<Border> borders;
  borders.reserve(4 * proxy.quads.size());
  for (std::uint32_t patch = 0; patch < proxy.quads.size(); ++patch)
    for (std::uint32_t k = 0; k < 4; ++k) {
      const std::uint32_t a = places[proxy.quads[patch][k]], b = places[proxy.quads[patch][(k + 1) % 4]];
      borders.push_back({std::min(a, b), std::max(a, b), patch, k});
    }
  std::sort(borders.begin(), borders.end(), [](const Border& a, const Border& b) {
    return std::tie(a.lo, a.hi, a.patch, a.corner) < std::tie(b.lo, b.hi, b.patch, b.corner);
  });
  PatchEdges edges;
  edges.of_patch.resize(proxy.quads.size());
  for (std::size_t i = 0; i < borders.size(); ++i) {
    if (i == 0 || borders[i].lo != borders[i - 1].lo || borders[i].hi != borders[i - 1].hi) ++edges.count;
    edges.of_patch[borders[i].patch][borders[i].corner] = edges.count - 1;
  }
  return edges;
}

std::vector<PatchLevel> match_borders(const PatchEdges& edges, std::span<const std::uint32_t> levels) {
  RBVH_CHECK(levels.size() == edges.of_patch.size());
  std::vector<std::uint32_t> least(edges.count, 32);
  for (std::size_t patch = 0; patch < levels.size(); ++patch)
    for (const std::uint32_t edge : edges.of_patch[patch]) least[edge] = std::min(least[edge], levels[patch]);
  std::vector<PatchLevel> matched(levels.size());
  for (std::size_t patch = 0; patch < levels.size(); ++patch) {
    matched[patch].level = levels[patch];
    for (std::size_t k = 0; k < 4; ++k) matched[patch].edges[k] = least[edges.of_patch[patch][k]];
  }
  return matched;
}

std::vector<std::uint32_t> uniform_levels(const Proxy& proxy, std::uint32_t most) {
  std::vector<std::uint32_t> levels;
  levels.reserve(proxy.tiles.size());
  for (const PatchTile& tile : proxy.tiles) levels.push_back(std::min(most, tile_level(tile)));
  return levels;
}

}  // namespace rbvh
