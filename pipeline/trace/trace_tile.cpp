#include "pipeline/trace/trace_tile.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "pipeline/base/error.h"
#include "pipeline/bvh/top_tree.h"
#include "pipeline/bvh/wide_nodes.h"
#include "pipeline/rbvh/tile.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kStack = 192;    ///< entries of the kernels' traversal stacks
constexpr float kChunkPadTexels = 0.1f;  ///< rounding must not lose a flat one

std::string options() { return "-DRBVH_STACK=" + std::to_string(kStack); }

/// At most RBVH_CHUNK primitives, side by side.
RbvhChunk make_chunk(std::span<const RbvhPrimitive> primitives) {
  RbvhChunk chunk;
  std::fill_n(&chunk.shape[0][0], 9 * RBVH_CHUNK, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t lane = 0; lane < primitives.size(); ++lane)
    for (std::size_t row = 0; row < 9; ++row) chunk.shape[row][lane] = primitives[lane].shape[row];
  return chunk;
}

Bounds3f bounds_of(std::span<const RbvhPrimitive> primitives, bool discs, float pad) {
  Bounds3f box;
  for (const RbvhPrimitive& primitive : primitives) {
    const float* s = primitive.shape;
    const Vec3f a{s[0], s[1], s[2]}, radius{s[3], s[3], s[3]};
    if (discs) {
      box.add(a - radius);
      box.add(a + radius);
    } else {
      for (const Vec3f& corner : {a, Vec3f{s[3], s[4], s[5]}, Vec3f{s[6], s[7], s[8]}}) box.add(corner);
    }
  }
  return {box.lo - Vec3f{pad, pad, pad}, box.hi + Vec3f{pad, pad, pad}};
}

float row_length(const float* row) { return std::sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2]); }

/// A leaf for tracing, and its texels at the end of `heights`: tile by tile, a march stays within a few cache
/// lines.
RbvhTile make_tile(const Level& level, std::uint32_t leaf_index, const RbvhNode& node,
                   std::vector<std::uint16_t>& heights) {
  const RbvhLeaf& leaf = level.leaves[leaf_index];
  const std::vector<std::uint16_t>& atlas = level.layers[0].texels;
  RbvhTile tile{};
  tile.leaf = leaf_index;
  tile.chunk = RBVH_NO_CHUNK;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      tile.columns[3 * column + row] = leaf.to_tile[4 * row + column];
  std::copy_n(node.lo, 3, tile.lo);
  std::copy_n(node.hi, 3, tile.hi);
  tile.offset = static_cast<std::uint32_t>(heights.size());
  tile.width = leaf.width;
  tile.height = leaf.height;
  tile.step_limit = kStepLimitTexels * row_length(leaf.to_tile + 8) / row_length(leaf.to_tile);
  for (std::size_t y = 0; y < leaf.height; ++y) {
    const auto row = atlas.begin() + static_cast<std::ptrdiff_t>((leaf.y + y) * level.atlas_width + leaf.x);
    heights.insert(heights.end(), row, row + leaf.width);
    tile.top = std::max(tile.top, static_cast<float>(*std::max_element(row, row + leaf.width)));
  }
  return tile;
}

/// The tree for tracing. A leaf that keeps its primitives is a tree of their chunks there, and each chunk a
/// tile.
struct TraceTree {
  std::vector<RbvhNode> nodes;
  std::vector<RbvhTile> tiles;
  std::vector<RbvhChunk> chunks;
};

/// Puts a tree of the primitives in the place of `node`.
void add_chunks(std::span<const RbvhPrimitive> primitives, bool discs, float texel, std::uint32_t node,
                RbvhTile tile, TraceTree& to) {
  const auto first_chunk = static_cast<std::uint32_t>(to.chunks.size()),
             first_tile = static_cast<std::uint32_t>(to.tiles.size()),
             moved = static_cast<std::uint32_t>(to.nodes.size()) - 1;
  std::vector<Bounds3f> boxes;
  for (std::size_t i = 0; i < primitives.size(); i += RBVH_CHUNK) {
    const auto chunk = primitives.subspan(i, std::min<std::size_t>(primitives.size() - i, RBVH_CHUNK));
    boxes.push_back(bounds_of(chunk, discs, kChunkPadTexels * texel));
    to.chunks.push_back(make_chunk(chunk));
  }
  const TopTree tree = build_top_tree(boxes);
  for (const std::uint32_t chunk : tree.order) {
    tile.chunk = first_chunk + chunk;
    to.tiles.push_back(tile);
  }
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    RbvhNode& here = n == 0 ? to.nodes[node] : to.nodes.emplace_back();
    here = tree.nodes[n];
    here.first += here.count == 0 ? moved : first_tile;
  }
}

}  // namespace

TileTracer make_tile_tracer(const Device& device, const Level& level) {
  RBVH_CHECK(!level.leaves.empty() && !level.layers.empty());
  std::vector<std::uint16_t> heights;
  TraceTree tree{.nodes = level.nodes, .tiles = {}, .chunks = {}};
  std::vector<std::uint32_t> node_of(level.leaves.size());
  for (std::uint32_t n = 0; n < level.nodes.size(); ++n)
    if (level.nodes[n].count == 1) node_of[level.nodes[n].first] = n;
  auto exact = level.exact_leaves.begin();
  for (std::uint32_t leaf = 0; leaf < level.leaves.size(); ++leaf) {
    const std::uint32_t node = node_of[leaf];
    const RbvhTile tile = make_tile(level, leaf, level.nodes[node], heights);
    if (exact != level.exact_leaves.end() && exact->leaf == leaf) {
      const auto kept =
          std::span(level.exact_primitives).subspan(exact++->first, level.leaves[leaf].primitives);
      add_chunks(kept, level.exact_discs, 1 / row_length(level.leaves[leaf].to_tile), node, tile, tree);
    } else {
      tree.nodes[node].first = static_cast<std::uint32_t>(tree.tiles.size());
      tree.tiles.push_back(tile);
    }
  }
  heights.push_back(0);  // the kernels may read one texel past the last
  if (tree.chunks.empty()) tree.chunks.resize(1);

  const WideNodes eight = flatten_wide(tree.nodes, 8), sixteen = flatten_wide(tree.nodes, 16);
  if (eight.stack_needed > kStack || sixteen.stack_needed > kStack)
    throw Error(ErrorKind::kInput, "", "the hierarchy is too deep to trace; build the pair again");
  TileTracer tracer(device);
  tracer.nodes8 = {device, eight.words};
  tracer.nodes16 = {device, sixteen.words};
  tracer.tiles = {device, tree.tiles};
  tracer.heights = {device, heights};
  tracer.exact = {device, tree.chunks};
  tracer.discs = level.exact_discs ? 1u : 0u;
  tracer.level = &level;
  return tracer;
}

void TileTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                           RayQuery query, const Buffer<std::uint32_t>* steps) const {
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  device.kernel("trace/trace_tile", "trace_tile_rays", options())
      .run(count, 64, nodes16, tiles, heights, exact, discs, rays, static_cast<std::uint32_t>(count),
           query == RayQuery::kAny ? 1u : 0u, hits, steps_out);
}

void TileTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                           const Buffer<std::uint32_t>* steps) const {
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  const auto blocks = [](std::uint32_t pixels, std::uint32_t side) {
    return static_cast<std::size_t>((pixels + side - 1) / side);
  };
  if (device.info().is_cpu)
    device.kernel("trace/trace_tile", "trace_tile_packets", options())
        .run(blocks(camera.width, 4) * blocks(camera.height, 4), 16, nodes8, tiles, heights, exact, discs,
             camera, hits, steps_out);
  else
    device.kernel("trace/trace_tile", "trace_tile_pixels", options())
        .run(blocks(camera.width, 8) * blocks(camera.height, 8) * 64, 64, nodes16, tiles, heights, exact,
             discs, camera, hits, steps_out);
}

SurfaceSamples TileTracer::surface(std::span<const Hit> hits) const { return sample_surface(*level, hits); }

std::uint64_t TileTracer::memory() const {
  return nodes8.size_bytes() + nodes16.size_bytes() + tiles.size_bytes() + heights.size_bytes() +
         exact.size_bytes();
}

}  // namespace rbvh
