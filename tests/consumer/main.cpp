// Casts one ray at a pair, from above the middle of its bounds straight down, and says what it hit.
#include <cstdio>
#include <exception>
#include <limits>

#include "rbvh/asset.h"
#include "rbvh/device.h"
#include "rbvh/tracer.h"

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: consumer FILE.rbvh\n");
    return 2;
  }
  const rbvh::Asset pair = rbvh::load_asset(argv[1]);
  const auto tracer = rbvh::make_tracer(rbvh::Device::open(), pair);  // at its finest level
  const rbvh::Vec3f middle = pair.bounds.center();
  const float above = pair.bounds.hi.z + 1;
  const rbvh::Ray ray = {{middle.x, middle.y, above}, 0, {0, 0, -1}, std::numeric_limits<float>::infinity()};
  const rbvh::Hit hit = rbvh::intersect(*tracer, {&ray, 1}).front();
  std::printf("hit at z = %.3f\n", static_cast<double>(above - hit.t));
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "consumer: %s\n", error.what());
  return 1;
}
