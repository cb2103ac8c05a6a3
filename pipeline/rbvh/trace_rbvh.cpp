#include "pipeline/rbvh/trace_rbvh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/tile.h"
#include "pipeline/rbvh/wide_nodes.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kStack = 192;  ///< entries of the kernels' traversal stacks

std::string options() { return "-DRBVH_STACK=" + std::to_string(kStack); }

/// Appends a leaf's primitives, RBVH_CHUNK side by side.
void append_chunks(std::span<const RbvhPrimitive> primitives, bool discs, std::vector<RbvhChunk>& chunks) {
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    const std::size_t lane = i % RBVH_CHUNK;
    const float* shape = primitives[i].shape;
    if (lane == 0) {
      RbvhChunk& chunk = chunks.emplace_back();
      std::fill_n(&chunk.shape[0][0], 9 * RBVH_CHUNK, std::numeric_limits<float>::quiet_NaN());
      std::fill_n(chunk.lo, 3, std::numeric_limits<float>::max());
      std::fill_n(chunk.hi, 3, std::numeric_limits<float>::lowest());
    }
    RbvhChunk& chunk = chunks.back();
    for (std::size_t row = 0; row < 9; ++row) chunk.shape[row][lane] = shape[row];
    for (int axis = 0; axis < 3; ++axis) {
      const float p = shape[axis], q = discs ? p - shape[3] : shape[axis + 3],
                  r = discs ? p + shape[3] : shape[axis + 6];
      chunk.lo[axis] = std::min({chunk.lo[axis], p, q, r});
      chunk.hi[axis] = std::max({chunk.hi[axis], p, q, r});
    }
  }
}

float row_length(const float* row) { return std::sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2]); }

}  // namespace

RbvhTracer make_rbvh_tracer(const Device& device, const Level& level) {
  RBVH_CHECK(!level.leaves.empty() && !level.layers.empty());
  RbvhTracer tracer{.device = device,
                    .nodes8 = {},
                    .nodes16 = {},
                    .leaves = {},
                    .heights = {},
                    .exact = {},
                    .discs = level.exact_discs ? 1u : 0u};
  const WideNodes eight = flatten_wide(level.nodes, 8), sixteen = flatten_wide(level.nodes, 16);
  if (eight.stack_needed > kStack || sixteen.stack_needed > kStack)
    throw Error(ExitCode::kInput, "", "the hierarchy is too deep to trace; build the pair again");
  tracer.nodes8 = Buffer<std::uint32_t>(device, eight.words);
  tracer.nodes16 = Buffer<std::uint32_t>(device, sixteen.words);

  // Tile by tile, so that a march stays within a few cache lines.
  std::vector<RbvhTile> leaves;
  std::vector<std::uint16_t> heights;
  const std::vector<std::uint16_t>& atlas = level.layers[0].texels;
  std::vector<const RbvhNode*> boxes(level.leaves.size());
  for (const RbvhNode& node : level.nodes)
    if (node.count == 1) boxes[node.first] = &node;
  std::vector<RbvhChunk> chunks;
  auto exact = level.exact_leaves.begin();
  for (const RbvhLeaf& leaf : level.leaves) {
    const RbvhNode& box = *boxes[static_cast<std::size_t>(&leaf - level.leaves.data())];
    RbvhTile& tile = leaves.emplace_back();
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 4; ++column)
        tile.columns[3 * column + row] = leaf.to_tile[4 * row + column];
    std::copy_n(box.lo, 3, tile.lo);
    std::copy_n(box.hi, 3, tile.hi);
    tile.offset = static_cast<std::uint32_t>(heights.size());
    tile.width = leaf.width;
    tile.height = leaf.height;
    tile.step_limit = kStepLimitTexels * row_length(leaf.to_tile + 8) / row_length(leaf.to_tile);
    for (std::size_t y = 0; y < leaf.height; ++y) {
      const auto row = atlas.begin() + static_cast<std::ptrdiff_t>((leaf.y + y) * level.atlas_width + leaf.x);
      heights.insert(heights.end(), row, row + leaf.width);
      tile.top = std::max(tile.top, static_cast<float>(*std::max_element(row, row + leaf.width)));
    }
    if (exact != level.exact_leaves.end() &&
        exact->leaf == static_cast<std::size_t>(&leaf - level.leaves.data())) {
      tile.exact_first = static_cast<std::uint32_t>(chunks.size());
      append_chunks(std::span(level.exact_primitives).subspan(exact++->first, leaf.primitives),
                    level.exact_discs, chunks);
      tile.exact_count = static_cast<std::uint32_t>(chunks.size()) - tile.exact_first;
    }
  }
  heights.push_back(0);  // the kernels may read one texel past the last
  tracer.leaves = Buffer<RbvhTile>(device, leaves);
  tracer.heights = Buffer<std::uint16_t>(device, heights);
  tracer.exact = chunks.empty() ? Buffer<RbvhChunk>(device, 1) : Buffer<RbvhChunk>(device, chunks);
  return tracer;
}

void trace_rays(const RbvhTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                RayQuery query, const Buffer<std::uint32_t>* steps) {
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  tracer.device.kernel("trace_rbvh", "trace_rbvh_rays", options())
      .run(count, 64, tracer.nodes16, tracer.leaves, tracer.heights, tracer.exact, tracer.discs, rays,
           static_cast<std::uint32_t>(count), query == RayQuery::kAny ? 1u : 0u, hits, steps_out);
}

void trace_camera(const RbvhTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps) {
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  const auto blocks = [](std::uint32_t pixels, std::uint32_t side) {
    return static_cast<std::size_t>((pixels + side - 1) / side);
  };
  if (tracer.device.info().is_cpu)
    tracer.device.kernel("trace_rbvh", "trace_rbvh_packets", options())
        .run(blocks(camera.width, 4) * blocks(camera.height, 4), 16, tracer.nodes8, tracer.leaves,
             tracer.heights, tracer.exact, tracer.discs, camera, hits, steps_out);
  else
    tracer.device.kernel("trace_rbvh", "trace_rbvh_pixels", options())
        .run(blocks(camera.width, 8) * blocks(camera.height, 8) * 64, 64, tracer.nodes16, tracer.leaves,
             tracer.heights, tracer.exact, tracer.discs, camera, hits, steps_out);
}

}  // namespace rbvh
