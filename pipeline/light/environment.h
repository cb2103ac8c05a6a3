// Sampling of light from infinitely far away, by how bright it is.
#pragma once

#include <vector>

#include "rbvh/light.h"

namespace rbvh {

/// A direction that light comes from.
struct LightSample {
  Vec3f direction;  ///< towards the light, unit
  Vec3f radiance;
  float pdf = 0;  ///< per solid angle; 0: no light
};

/// An environment made ready for sampling.
struct EnvironmentSampler {
  Environment environment;
  Vec3f x, y;                     ///< with `up`: the sky's axes
  std::vector<float> row_sums;    ///< cumulative weights of the sky's rows
  std::vector<float> pixel_sums;  ///< and of the pixels in each
  float sun_share = 0;            ///< the part of the samples that goes to the sun
  /// The same light from everywhere: a material samples that best.
  bool is_uniform = false;
  bool is_black = false;
};

EnvironmentSampler make_sampler(const Environment& environment);

Vec3f radiance(const EnvironmentSampler& sampler, Vec3f direction);
float pdf(const EnvironmentSampler& sampler, Vec3f direction);

/// By four numbers in [0, 1), of which three are used.
LightSample sample_light(const EnvironmentSampler& sampler, float choice, float u, float v);

inline float luminance(Vec3f c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

}  // namespace rbvh
