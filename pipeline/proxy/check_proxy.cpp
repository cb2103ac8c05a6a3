#include "pipeline/proxy/check_proxy.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "pipeline/proxy/patch_point.h"

namespace rbvh {
namespace {

using Fault = std::optional<std::string>;

std::string number(std::uint64_t n) { return std::to_string(n); }

bool is_vector(const Vec3f& v) {  // false for NaN
  return std::abs(v.x) <= kLargestProxyValue && std::abs(v.y) <= kLargestProxyValue &&
         std::abs(v.z) <= kLargestProxyValue;
}

bool is_side(std::uint32_t side) {
  return side >= 2 && side <= kMaxPatchSide && std::has_single_bit(side - 1);
}

float longest_of(const Proxy& proxy, const PatchTile& tile) {
  double longest = 0;
  for (std::uint32_t j = 0; j < tile.side; ++j)
    for (std::uint32_t i = 0; i < tile.side; ++i) {
      const Vec3d v(proxy.map[texel_index(proxy, tile, i, j)]);
      longest = std::max(longest, dot(v, v));
    }
  longest = std::sqrt(longest);
  const float rounded = static_cast<float>(longest);
  return rounded < longest ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
}

Fault find_tile_fault(const Proxy& proxy) {
  const std::uint64_t width = proxy.map_width, height = proxy.map_height;
  std::vector<bool> is_taken(width * height);
  std::vector<std::uint32_t> order(proxy.tiles.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto key = [&](std::uint32_t i) {
    const PatchTile& tile = proxy.tiles[i];
    return std::array{tile.y, tile.x, tile.side};
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  float longest = 0;
  for (std::size_t n = 0; n < order.size(); ++n) {
    const PatchTile& tile = proxy.tiles[order[n]];
    const std::string patch = "patch " + number(order[n]);
    if (!is_side(tile.side))
      return patch + " has a tile of " + number(tile.side) + " texels a side, not 2^k + 1";
    if (tile.x > width || tile.side > width - tile.x || tile.y > height || tile.side > height - tile.y)
      return patch + " has a tile that reaches out of the map";
    const bool is_shared = n > 0 && key(order[n]) == key(order[n - 1]);
    for (std::uint32_t j = 0; j < tile.side && !is_shared; ++j)
      for (std::uint32_t i = 0; i < tile.side; ++i) {
        const std::size_t at = texel_index(proxy, tile, i, j);
        if (is_taken[at]) return patch + " has a tile that overlaps another one's";
        is_taken[at] = true;
        if (!is_vector(proxy.map[at]))
          return patch + " has a displacement that is not finite or absurd, at texel " + number(i) + ", " +
                 number(j);
      }
    // A writer of another kind may have rounded otherwise.
    if (!is_shared) longest = longest_of(proxy, tile);
    if (!(tile.longest_displacement >= longest * (1 - 1e-5f)) || !(tile.longest_displacement <= 4e18f))
      return patch + " is displaced by up to " + std::to_string(longest) + " units, more than the " +
             std::to_string(tile.longest_displacement) + " that are claimed";
  }
  return {};
}

Vec3f edge_point(const Proxy& proxy, const QuadEdge& e, std::uint32_t k) {
  const TexelPlace place = texel_along(proxy, e, k);
  return surface_point(proxy, e.patch, place.i, place.j);
}

// Both sides hold the coarser one's points; the finer one's others lie between them.
Fault find_crack(const Proxy& proxy, const QuadEdge& a, const QuadEdge& b) {
  const bool a_is_coarse = proxy.tiles[a.patch].side <= proxy.tiles[b.patch].side;
  const QuadEdge& coarse = a_is_coarse ? a : b;
  const QuadEdge& fine = a_is_coarse ? b : a;
  const std::uint32_t steps = proxy.tiles[coarse.patch].side - 1;
  const std::uint32_t ratio = (proxy.tiles[fine.patch].side - 1) / steps;
  const std::string edge = "patches " + number(coarse.patch) + " and " + number(fine.patch) +
                           " do not have one surface along the edge that they share";
  Vec3f from = edge_point(proxy, coarse, 0);
  if (from != edge_point(proxy, fine, 0)) return edge;
  for (std::uint32_t k = 0; k < steps; ++k) {
    const Vec3f to = edge_point(proxy, coarse, k + 1);
    if (to != edge_point(proxy, fine, (k + 1) * ratio)) return edge;
    // Rounding: of a base point, of a texel and of their sum, each to half a unit in the last place.
    const float largest =
        std::max({std::abs(from.x), std::abs(from.y), std::abs(from.z), std::abs(to.x), std::abs(to.y),
                  std::abs(to.z), proxy.tiles[fine.patch].longest_displacement});
    for (std::uint32_t m = 1; m < ratio; ++m) {
      const Vec3f chord = mix(from, to, static_cast<float>(m) / static_cast<float>(ratio));
      if (length(chord - edge_point(proxy, fine, k * ratio + m)) > largest * 2e-6f) return edge;
    }
    from = to;
  }
  return {};
}

}  // namespace

std::vector<QuadEdge> sorted_edges(const std::vector<Quad>& quads) {
  std::vector<QuadEdge> edges;
  edges.reserve(quads.size() * 4);
  for (std::size_t patch = 0; patch < quads.size(); ++patch)
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t a = quads[patch][k], b = quads[patch][(k + 1) % 4];
      if (a != b)
        edges.push_back({std::min(a, b), std::max(a, b), static_cast<std::uint32_t>(patch),
                         static_cast<std::uint8_t>(k), a < b});
    }
  std::stable_sort(edges.begin(), edges.end(), [](const QuadEdge& a, const QuadEdge& b) {
    return a.lower != b.lower ? a.lower < b.lower : a.upper < b.upper;
  });
  return edges;
}

void for_each_edge(const Proxy& proxy, const EdgeWork& work) {
  const std::vector<QuadEdge> edges = sorted_edges(proxy.quads);
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    std::uint32_t steps = UINT32_MAX;
    for (; end < edges.size() && edges[end].lower == edges[begin].lower &&
           edges[end].upper == edges[begin].upper;
         ++end)
      steps = std::min(steps, proxy.tiles[edges[end].patch].side - 1);
    work(std::span(edges).subspan(begin, end - begin), steps);
  }
}

TexelPlace texel_along(const Proxy& proxy, const QuadEdge& edge, std::uint32_t k) {
  const std::uint32_t side = proxy.tiles[edge.patch].side;
  return edge_texel(side, edge.edge, edge.is_from_lower ? k : side - 1 - k);
}

std::optional<std::string> find_fault(const Proxy& proxy) {
  if (proxy.quads.empty()) return "has no patch";
  if (proxy.tiles.size() != proxy.quads.size())
    return "has " + number(proxy.quads.size()) + " quads and " + number(proxy.tiles.size()) + " tiles";
  if (proxy.map_width == 0 || proxy.map_height == 0 || proxy.map_width > kMaxMapSide ||
      proxy.map_height > kMaxMapSide || proxy.map.size() != std::uint64_t{proxy.map_width} * proxy.map_height)
    return "has a map whose size is not what it claims, or over 65536 texels a side";
  for (std::size_t i = 0; i < proxy.positions.size(); ++i)
    if (!is_vector(proxy.positions[i])) return "vertex " + number(i) + " is not finite or absurd";
  for (std::size_t i = 0; i < proxy.quads.size(); ++i)
    for (const std::uint32_t vertex : proxy.quads[i])
      if (vertex >= proxy.positions.size())
        return "patch " + number(i) + " names vertex " + number(vertex) + " of " +
               number(proxy.positions.size());
  if (Fault fault = find_tile_fault(proxy)) return fault;
  const std::vector<QuadEdge> edges = sorted_edges(proxy.quads);
  for (std::size_t i = 1; i < edges.size(); ++i)
    if (edges[i].lower == edges[i - 1].lower && edges[i].upper == edges[i - 1].upper)
      if (Fault fault = find_crack(proxy, edges[i - 1], edges[i])) return fault;
  return {};
}

void measure_displacements(Proxy& proxy) {
  for (PatchTile& tile : proxy.tiles) tile.longest_displacement = longest_of(proxy, tile);
}

}  // namespace rbvh
