#include "pipeline/trace/level_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/bvh/leaf_blocks.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/tile.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 64;                 // leaves of primitives
constexpr std::uint32_t kFarthestVertex = 0xffff;  // from a cluster's base, in steps

/// A tree over the blocks of one leaf's primitives: of a leaf these are order[first] ..
Bvh make_leaf_tree(const Scan& primitives, std::uint32_t first, std::uint32_t count) {
  std::vector<Bounds3f> boxes(count);
  for (std::uint32_t i = 0; i < count; ++i) boxes[i] = primitive_bounds(primitives, first + i);
  Bvh bvh = build_sah_binned_bvh(boxes, kLeafBlockConfig);
  for (std::uint32_t& i : bvh.order) i += first;
  if (primitives.radii.empty()) split_for_clusters(primitives, bvh);
  return bvh;
}

template <class Block>
void put_places(const RbvhPrimitiveLeaf& leaf, std::span<const std::uint32_t> primitives, Block& block) {
  block.leaf = leaf.leaf;
  for (std::size_t lane = 0; lane < LEAF_BLOCK_WIDTH; ++lane)
    block.places[lane] = static_cast<std::remove_reference_t<decltype(block.places[0])>>(
        primitives[std::min(lane, primitives.size() - 1)] - leaf.first);
}

/// False where the vertices are too far apart for a cluster, or none of the lattice's points.
bool fill_block(const Level& level, const RbvhPrimitiveLeaf& leaf, std::span<const std::uint32_t> triangles,
                LatticeCluster& cluster) {
  const Scan& scan = level.primitives;
  put_places(leaf, triangles, cluster);
  cluster.between = slab_of_triangles(scan, triangles);
  const std::vector<std::uint32_t> vertices = put_corners(scan, triangles, cluster);
  for (int axis = 0; axis < 3; ++axis) {
    const auto row = static_cast<std::size_t>(axis);
    std::int32_t places[LEAF_BLOCK_WIDTH];
    for (std::size_t i = 0; i < LEAF_BLOCK_WIDTH; ++i) {
      const Vec3f& p = scan.positions[vertices[i]];
      places[i] = lattice_number(level.lattice, p, axis);
      if (lattice_place(level.lattice, places[i], axis) != p[axis]) return false;
    }
    const auto [least, most] = std::minmax_element(std::begin(places), std::end(places));
    if (static_cast<std::uint32_t>(*most) - static_cast<std::uint32_t>(*least) > kFarthestVertex)
      return false;
    cluster.base[row] = *least;
    for (std::size_t i = 0; i < LEAF_BLOCK_WIDTH; ++i)
      cluster.vertices[row][i] = static_cast<std::uint16_t>(places[i] - *least);
  }
  return true;
}

bool fill_block(const Level& level, const RbvhPrimitiveLeaf& leaf, std::span<const std::uint32_t> triangles,
                FloatCluster& cluster) {
  put_places(leaf, triangles, cluster);
  fill_cluster(level.primitives, triangles, cluster);
  return true;
}

bool fill_block(const Level& level, const RbvhPrimitiveLeaf& leaf, std::span<const std::uint32_t> discs,
                DiscBlock& block) {
  put_places(leaf, discs, block);
  fill_discs(level.primitives, discs, block);
  return true;
}

/// The blocks of all leaf trees, in the order of the leaves' nodes. False where one of the kind cannot hold
/// what is in its place.
template <class Block>
bool fill_blocks(const Level& level, const std::vector<Bvh>& trees, std::vector<std::byte>& bytes) {
  std::vector<std::size_t> first(trees.size() + 1);
  for (std::size_t i = 0; i < trees.size(); ++i)
    first[i + 1] = first[i] + static_cast<std::size_t>(
                                  std::count_if(trees[i].nodes.begin(), trees[i].nodes.end(),
                                                [](const BvhNode& node) { return node.count > 0; }));
  std::vector<Block> blocks(std::max<std::size_t>(1, first.back()));
  std::vector<std::uint8_t> fits(trees.size(), 1);
  parallel_for(trees.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      std::size_t next = first[i];
      for (const BvhNode& node : trees[i].nodes)
        if (node.count > 0 &&
            !fill_block(level, level.primitive_leaves[i],
                        std::span(trees[i].order).subspan(node.first, node.count), blocks[next++]))
          fits[i] = 0;
    }
  });
  if (std::find(fits.begin(), fits.end(), 0) != fits.end()) return false;
  const std::span<const std::byte> all = std::as_bytes(std::span(blocks));
  bytes.assign(all.begin(), all.end());
  return true;
}

/// Says which kind they are.
std::string fill_blocks(const Level& level, const std::vector<Bvh>& trees, std::vector<std::byte>& bytes) {
  if (holds_discs(level)) {
    fill_blocks<DiscBlock>(level, trees, bytes);
    return " -DDISCS";
  }
  if (level.lattice.step > 0 && fill_blocks<LatticeCluster>(level, trees, bytes)) return " -DLATTICE";
  fill_blocks<FloatCluster>(level, trees, bytes);
  return "";
}

float row_length(const float* row) { return std::sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2]); }

RbvhTile make_tile(const RbvhLeaf& leaf, std::uint32_t leaf_index, const RbvhNode& node) {
  RbvhTile tile{};
  tile.leaf = leaf_index;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      tile.columns[3 * column + row] = leaf.to_tile[4 * row + column];
  std::copy_n(node.lo, 3, tile.lo);
  std::copy_n(node.hi, 3, tile.hi);
  tile.width = leaf.width;
  tile.height = leaf.height;
  tile.step_limit = kStepLimitTexels * row_length(leaf.to_tile + 8) / row_length(leaf.to_tile);
  return tile;
}

/// Puts the tile's texels at the end of `heights`: tile by tile, a march stays within a few cache lines.
void add_heights(const Level& level, const RbvhLeaf& leaf, RbvhTile& tile,
                 std::vector<std::uint16_t>& heights) {
  const std::vector<std::uint16_t>& atlas = level.layers[0].texels;
  tile.offset = static_cast<std::uint32_t>(heights.size());
  for (std::size_t y = 0; y < leaf.height; ++y) {
    const auto row = atlas.begin() + static_cast<std::ptrdiff_t>((leaf.y + y) * level.atlas_width + leaf.x);
    heights.insert(heights.end(), row, row + leaf.width);
    tile.top = std::max(tile.top, static_cast<float>(*std::max_element(row, row + leaf.width)));
  }
}

/// Puts a leaf's tree in the place of its node. Blocks are numbered from `block` on.
void add_leaf_tree(const Bvh& tree, std::uint32_t node, std::uint32_t& block, Bvh& to) {
  const auto moved = static_cast<std::uint32_t>(to.nodes.size()) - 1;
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    BvhNode here = tree.nodes[n];
    if (here.count == 0) {
      here.first += moved;
    } else {
      here.first = block++;
      here.count = 1;
    }
    if (n == 0)
      to.nodes[node] = here;
    else
      to.nodes.push_back(here);
  }
}

}  // namespace

LevelTree make_level_tree(const Level& level) {
  LevelTree result;
  result.tile_count = static_cast<std::uint32_t>(level.leaves.size() - level.primitive_leaves.size());
  std::vector<Bvh> trees(level.primitive_leaves.size());
  parallel_for(trees.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const RbvhPrimitiveLeaf& leaf = level.primitive_leaves[i];
      trees[i] = make_leaf_tree(level.primitives, leaf.first, level.leaves[leaf.leaf].primitives);
    }
  });
  result.block_options = fill_blocks(level, trees, result.blocks);
  std::vector<std::uint32_t> node_of(level.leaves.size());
  Bvh bvh;
  for (const RbvhNode& n : level.nodes) {
    if (n.count > 0) node_of[n.first] = static_cast<std::uint32_t>(bvh.nodes.size());
    bvh.nodes.push_back({{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}, n.first, n.count});
  }
  std::uint32_t block = result.tile_count;
  std::size_t next = 0;
  for (std::uint32_t leaf = 0; leaf < level.leaves.size(); ++leaf) {
    const std::uint32_t n = node_of[leaf];
    if (next < trees.size() && level.primitive_leaves[next].leaf == leaf) {
      add_leaf_tree(trees[next++], n, block, bvh);
      continue;
    }
    bvh.nodes[n].first = static_cast<std::uint32_t>(result.tiles.size());
    result.tiles.push_back(make_tile(level.leaves[leaf], leaf, level.nodes[n]));
    add_heights(level, level.leaves[leaf], result.tiles.back(), result.heights);
  }
  bvh.order.resize(block);
  std::iota(bvh.order.begin(), bvh.order.end(), 0u);
  result.wide = widen_elements(bvh);
  if (result.tiles.empty()) result.tiles.emplace_back();
  result.heights.push_back(0);
  return result;
}

}  // namespace rbvh
