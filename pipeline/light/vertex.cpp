#include "pipeline/light/vertex.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/vector_math.h"

namespace rbvh {
namespace {

constexpr float kRounding = 16 * std::numeric_limits<float>::epsilon();
constexpr float kLeastFacing = 1e-2f;  // of a shading normal to its viewer

Vec3f clamped(Vec3f c) {
  return {std::clamp(c.x, 0.f, 1.f), std::clamp(c.y, 0.f, 1.f), std::clamp(c.z, 0.f, 1.f)};
}

Vertex vertex_at(const PathConfig& config, const Ray& ray, float t) {
  Vertex v;
  const Vec3f origin = array3(ray.origin), direction = array3(ray.direction);
  v.point = origin + direction * t;
  v.at.view = -direction;
  const float size = std::max({std::abs(origin.x), std::abs(origin.y), std::abs(origin.z),
                               std::abs(v.point.x), std::abs(v.point.y), std::abs(v.point.z)});
  v.offset = config.offset + kRounding * (size + t);
  return v;
}

}  // namespace

Ray Vertex::leave(Vec3f direction, bool through) const {
  const Vec3f origin = point + at.geometric * (through ? -offset : offset);
  return {{origin.x, origin.y, origin.z},
          0,
          {direction.x, direction.y, direction.z},
          std::numeric_limits<float>::max()};
}

bool Vertex::leaves_ground(const Ground& ground, Vec3f direction) const {
  return dot(direction, ground.up) < 0 && dot(point - ground.point, ground.up) >= -offset;
}

Vertex make_ground_vertex(const PathConfig& config, const Ray& ray, float t) {
  Vertex v = vertex_at(config, ray, t);
  v.at.geometric = v.at.normal = config.ground->up;
  v.at.albedo = Vec3f{1, 1, 1} * config.ground->albedo;
  return v;
}

Vertex make_vertex(const PathConfig& config, const Ray& ray, const Hit& hit, const SurfaceSamples& surface,
                   std::size_t i) {
  Vertex v = vertex_at(config, ray, hit.t);
  v.material = config.material;
  v.at.geometric = array3(hit.normal);
  v.at.outside = dot(v.at.geometric, v.at.view) >= 0;
  if (!v.at.outside) v.at.geometric = -v.at.geometric;
  Vec3f normal = v.at.outside ? surface.normals[i] : -surface.normals[i];
  if (!(dot(normal, normal) > 0)) normal = v.at.geometric;
  // A smooth normal may turn away at the silhouette, where the surface itself does not.
  const float facing = dot(normal, v.at.view);
  if (facing < kLeastFacing) normal = normalized(normal + v.at.view * (kLeastFacing - facing));
  v.at.normal = normal;
  v.at.albedo = clamped(config.material.color    ? *config.material.color
                        : surface.colors.empty() ? kClay
                                                 : surface.colors[i]);
  return v;
}

Ray ray_onto(Vec3f point, Vec3f normal) {
  const Vec3f from = point + normal;
  return {{from.x, from.y, from.z}, 0, {-normal.x, -normal.y, -normal.z}, 1};
}

Hit hit_at(Vec3f normal) { return {1, {normal.x, normal.y, normal.z}, 0, 0, 0, 0}; }

float meet_ground(const Ground& ground, const Ray& ray, const Hit& hit) {
  const float falling = -dot(array3(ray.direction), ground.up),
              height = dot(array3(ray.origin) - ground.point, ground.up);
  if (!(falling > 0 && height > 0)) return 0;
  const float t = height / falling;
  return t < hit.t && std::isfinite(t) ? t : 0;
}

Ground ground_below(const Asset& asset, Vec3f up) {
  const Bounds3f& box = asset.bounds;
  return {{up.x > 0 ? box.lo.x : box.hi.x, up.y > 0 ? box.lo.y : box.hi.y, up.z > 0 ? box.lo.z : box.hi.z},
          up};
}

}  // namespace rbvh
