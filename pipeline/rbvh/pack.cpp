#include "pipeline/rbvh/pack.h"

#include <algorithm>
#include <span>
#include <utility>

#include "pipeline/bvh/top_tree.h"
#include "pipeline/rbvh/atlas.h"

namespace rbvh {
namespace {

/// Orders primitives so that those in the same RBVH_CHUNK places are close together, by halving along the
/// longest axis.
void sort_into_chunks(std::span<std::uint32_t> references, const std::vector<float>& shapes, bool discs) {
  const auto center = [&](std::uint32_t i) {
    const float* s = shapes.data() + 9 * std::size_t{i};
    const Vec3f p{s[0], s[1], s[2]};
    return discs ? p : (p + Vec3f{s[3], s[4], s[5]} + Vec3f{s[6], s[7], s[8]}) * (1.0f / 3);
  };
  // By number first: their order depends on other levels' splits.
  std::sort(references.begin(), references.end());
  if (references.size() <= RBVH_CHUNK) return;
  Bounds3f box;
  for (const std::uint32_t i : references) box.add(center(i));
  const Vec3f e = box.extent();
  const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
  std::stable_sort(references.begin(), references.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return center(a)[axis] < center(b)[axis]; });
  const std::size_t chunks = (references.size() + RBVH_CHUNK - 1) / RBVH_CHUNK,
                    middle = chunks / 2 * RBVH_CHUNK;
  sort_into_chunks(references.first(middle), shapes, discs);
  sort_into_chunks(references.subspan(middle), shapes, discs);
}

/// Of the leaves that fall back to them. `order`: the leaves' tiles.
void store_exact_primitives(Level& level, const RefinedLevel& refined,
                            const std::vector<std::uint32_t>& order, const Primitives& primitives) {
  std::vector<std::uint32_t> references;
  std::vector<float> shapes;
  for (std::uint32_t leaf = 0; leaf < order.size(); ++leaf) {
    const Tile& tile = refined.tiles[order[leaf]];
    if (tile.decision != LeafDecision::kExact) continue;
    if (references.empty()) {
      references = refined.partition.references.read();
      shapes = primitives.shape.read();
    }
    const PartitionNode& node = refined.partition.nodes[tile.node];
    sort_into_chunks(std::span(references).subspan(node.begin, node.count()), shapes, primitives.discs);
    level.exact_leaves.push_back({leaf, static_cast<std::uint32_t>(level.exact_primitives.size())});
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      RbvhPrimitive& primitive = level.exact_primitives.emplace_back();
      std::copy_n(shapes.begin() + 9 * static_cast<std::ptrdiff_t>(references[i]), 9, primitive.shape);
      if (!primitives.discs) continue;
      const Vec3f normal = normalized(Vec3f{primitive.shape[4], primitive.shape[5], primitive.shape[6]});
      std::copy_n(&normal.x, 3, primitive.shape + 4);
    }
  }
  level.exact_discs = primitives.discs;
}

}  // namespace

Level pack_level(const LevelConfig& config, RefinedLevel& refined, const Primitives& primitives) {
  std::vector<Tile>& tiles = refined.tiles;
  Level level;
  level.name = config.name;
  level.rho = config.rho;
  level.alpha = config.alpha;
  level.phi_degrees = config.phi_degrees;
  const AtlasSize size = pack_tiles(tiles);
  level.atlas_width = size.width;
  level.atlas_height = size.height;
  level.layers.push_back({"height", 1, assemble_layer(tiles, refined.texels.heights, size)});
  level.layers.push_back({"normal", 1, assemble_layer(tiles, refined.texels.normals, size)});
  if (primitives.has_colors)
    level.layers.push_back({"color", 1, assemble_layer(tiles, refined.texels.colors, size)});

  std::vector<Bounds3f> boxes(tiles.size());
  for (std::size_t k = 0; k < tiles.size(); ++k) boxes[k] = tiles[k].bounds;
  TopTree tree = build_top_tree(boxes);
  level.nodes = std::move(tree.nodes);
  for (const std::uint32_t k : tree.order) {
    level.leaves.push_back(tiles[k].leaf);
    level.bounds.add(tiles[k].bounds);
    level.texels_used += tiles[k].texels_used;
  }
  store_exact_primitives(level, refined, tree.order, primitives);
  return level;
}

}  // namespace rbvh
