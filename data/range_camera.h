// A simulated range camera: what a scanner on a tripod would measure of a shape, with its faults.
#pragma once

#include <cstdint>
#include <vector>

#include "demo_shape.h"
#include "pipeline/base/vec.h"

namespace rbvh::demo {

struct RangeCameraConfig {
  int width = 512;               ///< pixels, square images
  float noise = 1e-3f;           ///< standard deviation along a ray seen head on, scan units
  float registration = 1e-3f;    ///< how far a view as a whole is off, scan units
  float outlier_share = 2e-4f;   ///< of the measured pixels, those with a wild range
  float grazing_cosine = 0.12f;  ///< below it measurements thin out, to none at a third of it
  std::uint64_t seed = 1;
};

/// One view: ranges[y * width + x] is the distance along the pixel's ray, 0 where nothing was measured.
struct RangeImage {
  Vec3f eye, forward, right, up;  ///< right and up are scaled to one pixel on the plane at distance 1
  int width = 0;
  std::vector<float> ranges;
  std::vector<float> cosines;  ///< of the angle between ray and surface, estimated from the echo's strength

  /// Unit direction through the point (x, y) of the image; pixel centres are at whole numbers.
  Vec3f direction(float x, float y) const {
    const float half = 0.5f * static_cast<float>(width - 1);
    return normalized(forward + right * (x - half) + up * (half - y));
  }
};

/// The tripod's positions: rings at eye level, above and a little below; never under the plinth.
std::vector<Vec3f> tripod_places(const DemoShape& shape);

/// Same images for the same config, however many threads.
RangeImage take_range_image(const DemoShape& shape, Vec3f eye, std::uint64_t view,
                            const RangeCameraConfig& config);

/// Uniform in [0, 1), a function of its arguments alone.
float random_unit(std::uint64_t seed, std::uint64_t a, std::uint64_t b);

}  // namespace rbvh::demo
