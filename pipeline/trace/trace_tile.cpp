#include "pipeline/trace/trace_tile.h"

#include "pipeline/base/error.h"
#include "pipeline/trace/level_tree.h"
#include "pipeline/trace/surface.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kStackStep = 64;  ///< few stack sizes, as each is a kernel of its own

}  // namespace

TileTracer make_tile_tracer(const Device& device, const Level& level) {
  RBVH_CHECK(!level.leaves.empty() && !level.layers.empty());
  const LevelTree tree = make_level_tree(level);
  const std::uint32_t stack = (tree.wide.stack + kStackStep - 1) / kStackStep * kStackStep;
  TileTracer tracer(device);
  tracer.options = "-DSTACK=" + std::to_string(stack) + tree.block_options;
  tracer.scene = tree.wide.scene;
  tracer.nodes = {device, tree.wide.nodes};
  tracer.tiles = {device, tree.tiles};
  tracer.heights = {device, tree.heights};
  tracer.blocks = {device, tree.blocks};
  tracer.tile_count = tree.tile_count;
  const Vec3f& origin = level.lattice.origin;
  tracer.lattice = {{origin.x, origin.y, origin.z}, level.lattice.step};
  tracer.level = &level;
  return tracer;
}

void TileTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                           RayQuery query, const Buffer<std::uint32_t>* steps) const {
  const bool in_groups = device.info().is_cpu;  // a GPU's work-items have no room for 16 rays
  device.kernel("trace/trace_tile", in_groups ? "trace_ray_groups" : "trace_rays", options)
      .run(in_groups ? (count + 15) / 16 : count, in_groups ? 16 : 64, nodes, tiles, heights, blocks,
           tile_count, lattice, scene, rays, static_cast<std::uint32_t>(count),
           query == RayQuery::kAny ? 1u : 0u, hits, steps != nullptr ? *steps : Buffer<std::uint32_t>());
}

void TileTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                           const Buffer<std::uint32_t>* steps) const {
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  const auto squares = [](std::uint32_t pixels, std::uint32_t side) { return (pixels + side - 1) / side; };
  if (device.info().is_cpu) {
    const std::uint32_t in_row = squares(camera.width, 8);
    device.kernel("trace/trace_tile", "trace_camera_beams", options)
        .run(std::size_t{in_row} * squares(camera.height, 8), 4, nodes, tiles, heights, blocks, tile_count,
             lattice, scene, camera, in_row, hits, steps_out);
  } else {
    device.kernel("trace/trace_tile", "trace_camera", options)
        .run(std::size_t{squares(camera.width, 8)} * squares(camera.height, 8) * 64, 64, nodes, tiles,
             heights, blocks, tile_count, lattice, scene, camera, hits, steps_out);
  }
}

SurfaceSamples TileTracer::surface(std::span<const Hit> hits, float spread) const {
  return sample_surface(*level, hits, spread);
}

std::uint64_t TileTracer::memory() const {
  return nodes.size_bytes() + tiles.size_bytes() + heights.size_bytes() + blocks.size_bytes();
}

}  // namespace rbvh
