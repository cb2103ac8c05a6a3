#include "pipeline/trace/trace_tile.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "pipeline/base/error.h"
#include "pipeline/bvh/top_tree.h"
#include "pipeline/bvh/wide_bvh.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/tile.h"
#include "pipeline/trace/surface.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kStackStep = 64;  ///< few stack sizes, as each is a kernel of its own

/// The level's primitives [first, first + count) side by side, at most PRIMITIVE_BLOCK_WIDTH, all of one tile.
PrimitiveBlock make_block(const Scan& primitives, std::uint32_t first, std::uint32_t count,
                          std::uint32_t tile) {
  // A disc's centre, radius and normal become centre, normal and radius.
  constexpr std::size_t kDiscRows[9] = {0, 1, 2, 6, 3, 4, 5, 7, 8};
  PrimitiveBlock block = empty_block();
  for (std::size_t lane = 0; lane < count; ++lane) {
    const RbvhPrimitive shape = primitive_shape(primitives, first + static_cast<std::uint32_t>(lane));
    for (std::size_t i = 0; i < 9; ++i)
      block.rows[primitives.radii.empty() ? i : kDiscRows[i]][lane] = shape.shape[i];
    block.ids[lane] = tile;
  }
  return block;
}

float row_length(const float* row) { return std::sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2]); }

RbvhTile make_tile(const RbvhLeaf& leaf, std::uint32_t leaf_index, const RbvhNode& node) {
  RbvhTile tile{};
  tile.leaf = leaf_index;
  tile.block = RBVH_NO_BLOCK;
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

/// The tree for tracing. In the place of a leaf of primitives stands a tree of blocks of them, each a tile of
/// its own. Tiles are numbered by leaf, then by block: the order of the tie rule.
struct TraceTree {
  Bvh bvh;
  std::vector<RbvhTile> tiles;
  std::vector<PrimitiveBlock> blocks;
};

BvhNode binary_node(const RbvhNode& n) {
  return {{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}, n.first, n.count};
}

/// Puts a tree of the leaf's primitives in the place of `node`.
void add_blocks(const Level& level, std::uint32_t first, std::uint32_t node, RbvhTile tile, TraceTree& to) {
  const auto first_tile = static_cast<std::uint32_t>(to.tiles.size()),
             moved = static_cast<std::uint32_t>(to.bvh.nodes.size()) - 1;
  const std::uint32_t all = level.leaves[tile.leaf].primitives;
  std::vector<Bounds3f> boxes;
  for (std::uint32_t i = 0; i < all; i += PRIMITIVE_BLOCK_WIDTH) {
    const std::uint32_t count = std::min<std::uint32_t>(all - i, PRIMITIVE_BLOCK_WIDTH);
    Bounds3f& box = boxes.emplace_back();
    for (std::uint32_t k = 0; k < count; ++k) box.add(primitive_bounds(level.primitives, first + i + k));
    tile.block = static_cast<std::uint32_t>(to.blocks.size());
    tile.offset = i;
    to.blocks.push_back(
        make_block(level.primitives, first + i, count, static_cast<std::uint32_t>(to.tiles.size())));
    to.tiles.push_back(tile);
  }
  const TopTree tree = build_top_tree(boxes);
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    BvhNode& here = n == 0 ? to.bvh.nodes[node] : to.bvh.nodes.emplace_back();
    here = binary_node(tree.nodes[n]);
    here.first = here.count == 0 ? here.first + moved : first_tile + tree.order[here.first];
  }
}

TraceTree make_trace_tree(const Level& level, std::vector<std::uint16_t>& heights) {
  TraceTree tree;
  std::vector<std::uint32_t> node_of(level.leaves.size());
  for (std::uint32_t n = 0; n < level.nodes.size(); ++n) {
    const RbvhNode& node = level.nodes[n];
    tree.bvh.nodes.push_back(binary_node(node));
    if (node.count == 1) node_of[node.first] = n;
  }
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (std::uint32_t leaf = 0; leaf < level.leaves.size(); ++leaf) {
    const std::uint32_t node = node_of[leaf];
    RbvhTile tile = make_tile(level.leaves[leaf], leaf, level.nodes[node]);
    if (firsts[leaf] != RBVH_NO_LEAF) {
      add_blocks(level, firsts[leaf], node, tile, tree);
    } else {
      add_heights(level, level.leaves[leaf], tile, heights);
      tree.bvh.nodes[node].first = static_cast<std::uint32_t>(tree.tiles.size());
      tree.tiles.push_back(tile);
    }
  }
  tree.bvh.order.resize(tree.tiles.size());
  std::iota(tree.bvh.order.begin(), tree.bvh.order.end(), 0u);
  if (tree.blocks.empty()) tree.blocks.push_back(empty_block());
  return tree;
}

}  // namespace

TileTracer make_tile_tracer(const Device& device, const Level& level) {
  RBVH_CHECK(!level.leaves.empty() && !level.layers.empty());
  std::vector<std::uint16_t> heights;
  const TraceTree tree = make_trace_tree(level, heights);
  heights.push_back(0);  // the kernels may read one texel past the last
  const WideBvh wide = widen_elements(tree.bvh);
  const std::uint32_t stack = (wide.stack + kStackStep - 1) / kStackStep * kStackStep;
  TileTracer tracer(device);
  tracer.options = "-DSTACK=" + std::to_string(stack) + (holds_discs(level) ? " -DDISCS" : "");
  tracer.scene = wide.scene;
  tracer.nodes = {device, wide.nodes};
  tracer.tiles = {device, tree.tiles};
  tracer.heights = {device, heights};
  tracer.blocks = {device, tree.blocks};
  tracer.level = &level;
  return tracer;
}

void TileTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                           RayQuery query, const Buffer<std::uint32_t>* steps) const {
  device.kernel("trace/trace_tile", "trace_rays", options)
      .run(count, 64, nodes, tiles, heights, blocks, scene, rays, static_cast<std::uint32_t>(count),
           query == RayQuery::kAny ? 1u : 0u, hits, steps != nullptr ? *steps : Buffer<std::uint32_t>());
}

void TileTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                           const Buffer<std::uint32_t>* steps) const {
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  const auto squares = [](std::uint32_t pixels, std::uint32_t side) { return (pixels + side - 1) / side; };
  if (device.info().is_cpu) {
    const std::uint32_t in_row = squares(camera.width, 4);
    device.kernel("trace/trace_tile", "trace_camera_packets", options)
        .run(std::size_t{in_row} * squares(camera.height, 4), 16, nodes, tiles, heights, blocks, scene,
             camera, in_row, hits, steps_out);
  } else {
    device.kernel("trace/trace_tile", "trace_camera", options)
        .run(std::size_t{squares(camera.width, 8)} * squares(camera.height, 8) * 64, 64, nodes, tiles,
             heights, blocks, scene, camera, hits, steps_out);
  }
}

SurfaceSamples TileTracer::surface(std::span<const Hit> hits) const { return sample_surface(*level, hits); }

std::uint64_t TileTracer::memory() const {
  return nodes.size_bytes() + tiles.size_bytes() + heights.size_bytes() + blocks.size_bytes();
}

}  // namespace rbvh
