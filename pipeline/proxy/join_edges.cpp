#include "pipeline/proxy/join_edges.h"

#include <algorithm>

#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/patch_point.h"

namespace rbvh {
namespace {

// Texel k of `steps` + 1 along the edge, from its lower vertex to the other.
struct EdgeWalk {
  Proxy& proxy;
  const QuadEdge& edge;
  std::uint32_t side;

  EdgeWalk(Proxy& p, const QuadEdge& e) : proxy(p), edge(e), side(p.tiles[e.patch].side) {}
  TexelPlace place(std::uint32_t k) const {
    return edge_texel(side, edge.edge, edge.is_from_lower ? k : side - 1 - k);
  }
  Vec3f& texel(std::uint32_t k) const {
    const TexelPlace at = place(k);
    return proxy.map[texel_index(proxy, proxy.tiles[edge.patch], at.i, at.j)];
  }
  Vec3f base(std::uint32_t k) const {
    const TexelPlace at = place(k);
    return base_point(proxy, proxy.quads[edge.patch], side, at.i, at.j);
  }
};

}  // namespace

void join_edges(Proxy& proxy) {
  const std::vector<QuadEdge> edges = sorted_edges(proxy.quads);
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    std::uint32_t steps = UINT32_MAX;
    for (; end < edges.size() && edges[end].lower == edges[begin].lower &&
           edges[end].upper == edges[begin].upper;
         ++end)
      steps = std::min(steps, proxy.tiles[edges[end].patch].side - 1);
    const EdgeWalk first(proxy, edges[begin]);
    const std::uint32_t first_ratio = (first.side - 1) / steps;
    for (std::size_t e = begin; e < end; ++e) {
      const EdgeWalk walk(proxy, edges[e]);
      const std::uint32_t ratio = (walk.side - 1) / steps;
      for (std::uint32_t k = 0; k <= steps; ++k) walk.texel(k * ratio) = first.texel(k * first_ratio);
      for (std::uint32_t k = 0; k < steps; ++k) {
        const Vec3f from = walk.base(k * ratio) + walk.texel(k * ratio);
        const Vec3f to = walk.base((k + 1) * ratio) + walk.texel((k + 1) * ratio);
        for (std::uint32_t m = 1; m < ratio; ++m)
          walk.texel(k * ratio + m) =
              mix(from, to, static_cast<float>(m) / static_cast<float>(ratio)) - walk.base(k * ratio + m);
      }
    }
  }
  measure_displacements(proxy);
}

}  // namespace rbvh
