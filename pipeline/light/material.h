// How a surface scatters light: evaluated, and sampled.
#pragma once

#include "rbvh/light.h"

namespace rbvh {

/// Where light is scattered, seen from the side that the ray came from. Unit vectors.
struct ShadingPoint {
  Vec3f geometric;  ///< normal; dot(geometric, view) >= 0
  Vec3f normal;     ///< for shading: smooth, dot(normal, view) > 0
  Vec3f view;       ///< back along the ray
  Vec3f albedo;
  bool outside = true;  ///< the ray came from the surface's front
};

/// The next direction of a path.
struct ScatterSample {
  Vec3f direction;
  Vec3f weight;             ///< BSDF * |cos| / pdf
  float pdf = 0;            ///< per solid angle; 0: absorbed
  bool is_mirror = false;   ///< no other direction could have been sampled
  bool is_through = false;  ///< leaves on the other side
};

/// BSDF times |cos| towards a light, and the density with which sample() finds that direction. Mirrors: zero.
struct Scattering {
  Vec3f value;
  float pdf = 0;
};

Scattering evaluate(const Material& material, const ShadingPoint& at, Vec3f to_light);

/// By three numbers in [0, 1).
ScatterSample sample(const Material& material, const ShadingPoint& at, float choice, float u, float v);

}  // namespace rbvh
