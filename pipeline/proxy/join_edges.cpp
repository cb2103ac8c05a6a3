#include "pipeline/proxy/join_edges.h"

#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/patch_point.h"

namespace rbvh {
namespace {

// Texel k of `steps` + 1 along the edge, from its lower vertex to the other.
struct EdgeTexels {
  Proxy& proxy;
  const QuadEdge& edge;
  std::uint32_t side;

  EdgeTexels(Proxy& p, const QuadEdge& e) : proxy(p), edge(e), side(p.tiles[e.patch].side) {}
  Vec3f& texel(std::uint32_t k) const {
    const TexelPlace at = texel_along(proxy, edge, k);
    return proxy.map[texel_index(proxy, proxy.tiles[edge.patch], at.i, at.j)];
  }
  Vec3f base(std::uint32_t k) const {
    const TexelPlace at = texel_along(proxy, edge, k);
    return base_point(proxy, proxy.quads[edge.patch], side, at.i, at.j);
  }
};

}  // namespace

void join_edges(Proxy& proxy) {
  for_each_edge(proxy, [&](std::span<const QuadEdge> patches, std::uint32_t steps) {
    const EdgeTexels first(proxy, patches[0]);
    const std::uint32_t first_ratio = (first.side - 1) / steps;
    for (const QuadEdge& patch : patches) {
      const EdgeTexels edge(proxy, patch);
      const std::uint32_t ratio = (edge.side - 1) / steps;
      for (std::uint32_t k = 0; k <= steps; ++k) edge.texel(k * ratio) = first.texel(k * first_ratio);
      for (std::uint32_t k = 0; k < steps; ++k) {
        const Vec3f from = edge.base(k * ratio) + edge.texel(k * ratio);
        const Vec3f to = edge.base((k + 1) * ratio) + edge.texel((k + 1) * ratio);
        for (std::uint32_t m = 1; m < ratio; ++m)
          edge.texel(k * ratio + m) =
              mix(from, to, static_cast<float>(m) / static_cast<float>(ratio)) - edge.base(k * ratio + m);
      }
    }
  });
  measure_displacements(proxy);
}

}  // namespace rbvh
