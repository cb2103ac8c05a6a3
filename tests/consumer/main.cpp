// Casts one ray at a pair, from above the middle of its bounds straight down, and says what it hit.
#include <cstdio>
#include <exception>
#include <limits>

#include "io/rbvh_file.h"
#include "pipeline/device/device.h"
#include "pipeline/trace/trace_tile.h"

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: consumer FILE.rbvh\n");
    return 2;
  }
  const rbvh::Rbvh pair = rbvh::read_rbvh(argv[1]);
  const rbvh::Level& level = *pair.find_level("");  // the finest
  const rbvh::Device device = rbvh::Device::open();
  const rbvh::TileTracer tracer = rbvh::make_tile_tracer(device, level);

  const rbvh::Vec3f middle = level.bounds.center();
  const float above = level.bounds.hi.z + 1;
  const std::vector<rbvh::Ray> rays = {
      {{middle.x, middle.y, above}, 0, {0, 0, -1}, std::numeric_limits<float>::infinity()}};
  const rbvh::Buffer<rbvh::Ray> device_rays(device, rays);
  const rbvh::Buffer<rbvh::Hit> device_hits(device, rays.size());
  tracer.intersect(device_rays, device_hits, rays.size(), rbvh::RayQuery::kNearest);
  const rbvh::Hit hit = device_hits.read().front();
  std::printf("hit at z = %.3f\n", static_cast<double>(above - hit.t));
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "consumer: %s\n", error.what());
  return 1;
}
