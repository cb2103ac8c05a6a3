// A path's vertex: where light is scattered on a surface or on the ground, and how rays leave it.
#pragma once

#include "pipeline/light/material.h"

namespace rbvh {

struct Vertex {
  ShadingPoint at;
  Vec3f point;
  float offset = 0;  ///< of rays that leave
  Material material;

  /// A ray without end; `through`: on the other side.
  Ray leave(Vec3f direction, bool through) const;

  /// Whether light from `direction` comes through the ground.
  bool leaves_ground(const Ground& ground, Vec3f direction) const;
};

/// The i-th hit of a batch.
Vertex make_vertex(const PathConfig& config, const Ray& ray, const Hit& hit, const SurfaceSamples& surface,
                   std::size_t i);

/// A white, matte point of a surface, as if a ray had come straight down on it: what ray_onto() and hit_at()
/// make a vertex of.
Ray ray_onto(Vec3f point, Vec3f normal);
Hit hit_at(Vec3f normal);

/// On the ground, at distance t.
Vertex make_ground_vertex(const PathConfig& config, const Ray& ray, float t);

/// Where the ray meets the ground's upper side before `hit`; 0: nowhere.
float meet_ground(const Ground& ground, const Ray& ray, const Hit& hit);

}  // namespace rbvh
