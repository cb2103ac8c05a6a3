#include "pipeline/trace/trace_tile.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "pipeline/base/error.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/bvh/wide_bvh.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/tile.h"
#include "pipeline/trace/surface.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kStackStep = 64;  ///< few stack sizes, as each is a kernel of its own

/// Into a lane of a block. `tiles`: numbers before those of primitives.
void put_primitive(const Scan& primitives, std::uint32_t primitive, std::uint32_t tiles, std::uint32_t lane,
                   PrimitiveBlock& block) {
  // A disc's centre, radius and normal become centre, normal and radius.
  constexpr std::size_t kDiscRows[9] = {0, 1, 2, 6, 3, 4, 5, 7, 8};
  const RbvhPrimitive shape = primitive_shape(primitives, primitive);
  for (std::size_t i = 0; i < 9; ++i)
    block.rows[primitives.radii.empty() ? i : kDiscRows[i]][lane] = shape.shape[i];
  block.ids[lane] = tiles + primitive;
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

/// The tree for tracing. Its leaves are tiles and, numbered after these, blocks of primitives, whose ids are
/// the numbers of primitives after those of tiles: the order of the tie rule.
struct TraceTree {
  Bvh bvh;
  std::vector<RbvhTile> tiles;
  std::vector<PrimitiveBlock> blocks;
};

BvhNode binary_node(const RbvhNode& n) {
  return {{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}, n.first, n.count};
}

/// Puts a tree of the level's primitives [first, first + count) in the place of `node`. `tiles`: of the
/// level.
void add_blocks(const Level& level, std::uint32_t first, std::uint32_t count, std::uint32_t tiles,
                std::uint32_t node, TraceTree& to) {
  std::vector<Bounds3f> boxes(count);
  for (std::uint32_t i = 0; i < count; ++i) boxes[i] = primitive_bounds(level.primitives, first + i);
  const Bvh bvh = build_sah_binned_bvh(
      boxes, BvhConfig{.leaf_size = PRIMITIVE_BLOCK_WIDTH, .test_width = PRIMITIVE_BLOCK_WIDTH});
  const auto moved = static_cast<std::uint32_t>(to.bvh.nodes.size()) - 1;
  for (std::size_t n = 0; n < bvh.nodes.size(); ++n) {
    const BvhNode& from = bvh.nodes[n];
    BvhNode here = from;
    if (from.count == 0) {
      here.first += moved;
    } else {
      here.first = tiles + static_cast<std::uint32_t>(to.blocks.size());
      here.count = 1;
      PrimitiveBlock& block = to.blocks.emplace_back(empty_block());
      for (std::uint32_t lane = 0; lane < from.count; ++lane)
        put_primitive(level.primitives, first + bvh.order[from.first + lane], tiles, lane, block);
    }
    if (n == 0)
      to.bvh.nodes[node] = here;
    else
      to.bvh.nodes.push_back(here);
  }
}

TraceTree make_trace_tree(const Level& level, std::vector<std::uint16_t>& heights) {
  TraceTree tree;
  const auto tiles = static_cast<std::uint32_t>(level.leaves.size() - level.primitive_leaves.size());
  if (tiles == 0) {
    // The stored tree is a grouping for the file: one over all primitives is better to traverse.
    tree.bvh.nodes.resize(1);
    add_blocks(level, 0, static_cast<std::uint32_t>(primitive_count(level)), 0, 0, tree);
  } else {
    for (const RbvhNode& node : level.nodes) tree.bvh.nodes.push_back(binary_node(node));
    const std::vector<std::uint32_t> firsts = first_primitives(level);
    for (std::uint32_t n = 0; n < level.nodes.size(); ++n) {
      const RbvhNode& node = level.nodes[n];
      if (node.count == 0) continue;
      const RbvhLeaf& leaf = level.leaves[node.first];
      if (firsts[node.first] != RBVH_NO_LEAF) {
        add_blocks(level, firsts[node.first], leaf.primitives, tiles, n, tree);
        continue;
      }
      tree.bvh.nodes[n].first = static_cast<std::uint32_t>(tree.tiles.size());
      tree.tiles.push_back(make_tile(leaf, node.first, node));
      add_heights(level, leaf, tree.tiles.back(), heights);
    }
  }
  tree.bvh.order.resize(tiles + tree.blocks.size());
  std::iota(tree.bvh.order.begin(), tree.bvh.order.end(), 0u);
  if (tree.blocks.empty()) tree.blocks.push_back(empty_block());
  if (tree.tiles.empty()) tree.tiles.emplace_back();
  return tree;
}

/// For each primitive its leaf, and its place among the leaf's.
struct PrimitivePlaces {
  std::vector<std::uint32_t> leaf_of = {};
  std::vector<std::uint8_t> place_of = {};
};

PrimitivePlaces primitive_places(const Level& level) {
  PrimitivePlaces places;
  for (const RbvhPrimitiveLeaf& leaf : level.primitive_leaves)
    for (std::uint32_t i = 0; i < level.leaves[leaf.leaf].primitives; ++i) {
      places.leaf_of.push_back(leaf.leaf);
      places.place_of.push_back(static_cast<std::uint8_t>(i));
    }
  if (places.leaf_of.empty()) {
    places.leaf_of.push_back(0);
    places.place_of.push_back(0);
  }
  return places;
}

}  // namespace

TileTracer make_tile_tracer(const Device& device, const Level& level) {
  RBVH_CHECK(!level.leaves.empty() && !level.layers.empty());
  std::vector<std::uint16_t> heights;
  const TraceTree tree = make_trace_tree(level, heights);
  heights.push_back(0);  // the kernels may read one texel past the last
  const PrimitivePlaces places = primitive_places(level);
  const WideBvh wide = widen_elements(tree.bvh);
  const std::uint32_t stack = (wide.stack + kStackStep - 1) / kStackStep * kStackStep;
  TileTracer tracer(device);
  tracer.options = "-DSTACK=" + std::to_string(stack) + (holds_discs(level) ? " -DDISCS" : "");
  tracer.scene = wide.scene;
  tracer.nodes = {device, wide.nodes};
  tracer.tiles = {device, tree.tiles};
  tracer.heights = {device, heights};
  tracer.blocks = {device, tree.blocks};
  tracer.leaf_of = {device, places.leaf_of};
  tracer.place_of = {device, places.place_of};
  tracer.tile_count = static_cast<std::uint32_t>(level.leaves.size() - level.primitive_leaves.size());
  tracer.level = &level;
  return tracer;
}

void TileTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                           RayQuery query, const Buffer<std::uint32_t>* steps) const {
  device.kernel("trace/trace_tile", "trace_rays", options)
      .run(count, 64, nodes, tiles, heights, blocks, leaf_of, place_of, tile_count, scene, rays,
           static_cast<std::uint32_t>(count), query == RayQuery::kAny ? 1u : 0u, hits,
           steps != nullptr ? *steps : Buffer<std::uint32_t>());
}

void TileTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                           const Buffer<std::uint32_t>* steps) const {
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  const auto squares = [](std::uint32_t pixels, std::uint32_t side) { return (pixels + side - 1) / side; };
  if (device.info().is_cpu) {
    const std::uint32_t in_row = squares(camera.width, 4);
    device.kernel("trace/trace_tile", "trace_camera_packets", options)
        .run(std::size_t{in_row} * squares(camera.height, 4), 16, nodes, tiles, heights, blocks, leaf_of,
             place_of, tile_count, scene, camera, in_row, hits, steps_out);
  } else {
    device.kernel("trace/trace_tile", "trace_camera", options)
        .run(std::size_t{squares(camera.width, 8)} * squares(camera.height, 8) * 64, 64, nodes, tiles,
             heights, blocks, leaf_of, place_of, tile_count, scene, camera, hits, steps_out);
  }
}

SurfaceSamples TileTracer::surface(std::span<const Hit> hits) const { return sample_surface(*level, hits); }

std::uint64_t TileTracer::memory() const {
  return nodes.size_bytes() + tiles.size_bytes() + heights.size_bytes() + blocks.size_bytes() +
         leaf_of.size_bytes() + place_of.size_bytes();
}

}  // namespace rbvh
