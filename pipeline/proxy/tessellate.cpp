#include "pipeline/proxy/tessellate.h"

#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/proxy/patch_point.h"

namespace rbvh {
namespace {

// The same arithmetic as in kernels/trace/patch_surface.h.
std::uint32_t snapped(std::uint32_t i, std::uint32_t level, std::uint32_t edge) {
  const std::uint32_t step = 1u << (level - edge);
  return (i + step / 2) & ~(step - 1);
}

struct Place {
  std::uint32_t i, j;
  bool operator==(const Place&) const = default;
};

Place place_of(const PatchLevel& level, std::uint32_t i, std::uint32_t j) {
  const std::uint32_t n = 1u << level.level;
  if (j == 0) i = snapped(i, level.level, level.edges[0]);
  if (i == n) j = snapped(j, level.level, level.edges[1]);
  if (j == n) i = snapped(i, level.level, level.edges[2]);
  if (i == 0) j = snapped(j, level.level, level.edges[3]);
  return {i, j};
}

Vec3f vertex_at(const Proxy& proxy, std::size_t patch, std::uint32_t level, Place place) {
  const PatchTile& tile = proxy.tiles[patch];
  const std::uint32_t shift = tile_level(tile) - level;
  return base_point(proxy, proxy.quads[patch], (1u << level) + 1, place.i, place.j) +
         proxy.map[texel_index(proxy, tile, place.i << shift, place.j << shift)];
}

}  // namespace

Vec3f patch_vertex(const Proxy& proxy, std::size_t patch, const PatchLevel& level, std::uint32_t i,
                   std::uint32_t j) {
  return vertex_at(proxy, patch, level.level, place_of(level, i, j));
}

Scan tessellate(const Proxy& proxy, std::span<const PatchLevel> levels, std::vector<std::uint32_t>* patches) {
  RBVH_CHECK(levels.size() == proxy.quads.size() && proxy.tiles.size() == proxy.quads.size());
  std::vector<std::size_t> first_vertex(levels.size() + 1, 0);
  std::size_t micro_quads = 0;
  for (std::size_t p = 0; p < levels.size(); ++p) {
    const std::size_t n = std::size_t{1} << levels[p].level;
    first_vertex[p + 1] = first_vertex[p] + (n + 1) * (n + 1);
    micro_quads += n * n;
  }
  if (std::max(first_vertex.back(), 2 * micro_quads) >= std::numeric_limits<std::uint32_t>::max())
    throw Error(ErrorKind::kBudget, {},
                "tessellated, the proxy has " + std::to_string(2 * micro_quads) +
                    " triangles: more than can be numbered; tessellate it coarser");
  Scan mesh;
  mesh.positions.resize(first_vertex.back());
  parallel_for(levels.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      const std::uint32_t n = 1u << levels[p].level;
      Vec3f* to = &mesh.positions[first_vertex[p]];
      for (std::uint32_t j = 0; j <= n; ++j)
        for (std::uint32_t i = 0; i <= n; ++i) *to++ = patch_vertex(proxy, p, levels[p], i, j);
    }
  });
  mesh.triangles.reserve(2 * micro_quads);
  if (patches) patches->clear();
  for (std::size_t p = 0; p < levels.size(); ++p) {
    const std::uint32_t n = 1u << levels[p].level;
    const auto index = [&](std::uint32_t i, std::uint32_t j) {
      return static_cast<std::uint32_t>(first_vertex[p] + std::size_t{j} * (n + 1) + i);
    };
    const auto add = [&](std::array<Place, 3> corners) {
      for (std::size_t k = 0; k < 3; ++k)
        if (place_of(levels[p], corners[k].i, corners[k].j) ==
            place_of(levels[p], corners[(k + 1) % 3].i, corners[(k + 1) % 3].j))
          return;
      mesh.triangles.push_back({index(corners[0].i, corners[0].j), index(corners[1].i, corners[1].j),
                                index(corners[2].i, corners[2].j)});
      if (patches) patches->push_back(static_cast<std::uint32_t>(p));
    };
    for (std::uint32_t j = 0; j < n; ++j)
      for (std::uint32_t i = 0; i < n; ++i) {
        add({{{i, j}, {i + 1, j}, {i + 1, j + 1}}});
        add({{{i, j}, {i + 1, j + 1}, {i, j + 1}}});
      }
  }
  return mesh;
}

Scan tessellate(const Proxy& proxy, std::uint32_t most, std::vector<std::uint32_t>* patches) {
  return tessellate(proxy, match_borders(find_edges(proxy), uniform_levels(proxy, most)), patches);
}

}  // namespace rbvh
