#include "pipeline/scene/trace_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <variant>

#include "kernels/scene_layout.h"
#include "pipeline/base/error.h"

namespace rbvh {

struct SceneTracerState {
  struct Placed {  ///< an instance that is no proxy
    std::uint32_t tracer = 0;
    ScenePlacement placement{};
  };
  std::vector<std::variant<RbvhTracer, ExactTracer>> tracers;
  std::vector<Placed> placed;
  std::optional<ProxyTracer> proxies;
  double pixels = 1;

  std::size_t scratch_rays = 0;
  Buffer<Ray> placed_rays;
  Buffer<Hit> placed_hits;
  Buffer<std::uint32_t> ids, placed_steps, placed_count;
};

namespace {

constexpr std::size_t kGroup = 64;

ScenePlacement place(const Bounds3f& box, const SceneInstance& instance, std::uint32_t first_leaf) {
  ScenePlacement placement{};
  const Affine to_object = inverse(instance.to_world);
  for (std::size_t i = 0; i < 12; ++i) placement.to_object[i] = static_cast<float>(to_object.m[i]);
  const Bounds3d image =
      transformed(instance.to_world, {static_cast<Vec3d>(box.lo), static_cast<Vec3d>(box.hi)});
  const double pad = 1e-5 * (length(image.extent()) + std::max(length(image.lo), length(image.hi)));
  for (int axis = 0; axis < 3; ++axis) {
    placement.lo[axis] = static_cast<float>(image.lo[axis] - pad);
    placement.hi[axis] = static_cast<float>(image.hi[axis] + pad);
  }
  placement.first_leaf = first_leaf;
  return placement;
}

/// What of the object rays can hit: a cloud's discs and a level's tiles reach past what bounds() says.
Bounds3f reach(const SceneObject& object) {
  Bounds3f box = object.bounds;
  if (const Level* level = object.level()) {
    if (!level->nodes.empty())
      box = {{level->nodes[0].lo[0], level->nodes[0].lo[1], level->nodes[0].lo[2]},
             {level->nodes[0].hi[0], level->nodes[0].hi[1], level->nodes[0].hi[2]}};
  } else if (const Scan* scan = object.scan(); scan != nullptr && scan->is_cloud()) {
    for (std::size_t i = 0; i < scan->positions.size(); ++i) {
      const float r = scan->radii[i];
      if (!is_finite(scan->positions[i]) || !std::isfinite(r)) continue;
      box.add(scan->positions[i] - Vec3f{r, r, r});
      box.add(scan->positions[i] + Vec3f{r, r, r});
    }
  }
  return box;
}

void grow_scratch(const Device& device, SceneTracerState& state, std::size_t rays) {
  if (rays <= state.scratch_rays) return;
  state.scratch_rays = rays;
  state.placed_rays = {device, rays};
  state.placed_hits = {device, rays};
  state.ids = {device, rays};
  state.placed_steps = {device, rays};
  state.placed_count = {device, 1};
}

void trace_with_levels(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                       std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps) {
  SceneTracerState& state = *tracer.state;
  const Device& device = tracer.device;
  RBVH_CHECK(rays.size() >= count && hits.size() >= count && (steps == nullptr || steps->size() >= count));
  const Buffer<std::uint32_t> steps_out = steps != nullptr ? *steps : Buffer<std::uint32_t>();
  const auto total = static_cast<std::uint32_t>(count);
  device.kernel("trace_scene", "clear_hits").run(count, kGroup, hits, total, steps_out);
  if (!state.placed.empty()) grow_scratch(device, state, count);
  for (const SceneTracerState::Placed& placed : state.placed) {
    state.placed_count.fill(0);
    device.kernel("trace_scene", "place_rays")
        .run(count, kGroup, rays, hits, total, query == RayQuery::kAny ? 1u : 0u, placed.placement,
             state.placed_rays, state.ids, state.placed_count);
    std::uint32_t going_in = 0;
    state.placed_count.read(std::span(&going_in, 1));
    if (going_in == 0) continue;
    std::visit(
        [&](const auto& kind) {
          trace_rays(kind, state.placed_rays, state.placed_hits, going_in, query,
                     steps != nullptr ? &state.placed_steps : nullptr);
        },
        state.tracers[placed.tracer]);
    device.kernel("trace_scene", "take_placed_hits")
        .run(going_in, kGroup, state.placed_hits, state.ids, going_in, placed.placement, rays, hits,
             state.placed_steps, steps_out);
  }
  if (state.proxies) trace_rays_further(*state.proxies, rays, hits, count, query, steps);
}

}  // namespace

SceneTracer make_scene_tracer(const Device& device, const Scene& scene, const SceneConfig& config) {
  SceneTracer tracer{device, std::make_shared<SceneTracerState>()};
  SceneTracerState& state = *tracer.state;
  state.pixels = config.pixels;
  const std::vector<std::uint32_t> first = first_leaves(scene);
  std::vector<const Proxy*> proxies;
  std::vector<std::uint32_t> number;  // of each object among its kind
  std::vector<Bounds3f> boxes;
  for (const SceneObject& object : scene.objects) {
    boxes.push_back(reach(object));
    if (const Proxy* proxy = object.proxy()) {
      number.push_back(static_cast<std::uint32_t>(proxies.size()));
      proxies.push_back(proxy);
      continue;
    }
    number.push_back(static_cast<std::uint32_t>(state.tracers.size()));
    if (const Level* level = object.level())
      state.tracers.emplace_back(make_rbvh_tracer(device, *level));
    else
      state.tracers.emplace_back(make_exact_tracer(device, *object.scan(), config.exact));
  }
  std::vector<ProxyInstance> proxy_instances;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const SceneInstance& instance = scene.instances[i];
    const SceneObject& object = scene.objects[instance.object];
    if (object.proxy() != nullptr) {
      proxy_instances.push_back({number[instance.object], instance.to_world, first[i]});
    } else {
      state.placed.push_back({number[instance.object], place(boxes[instance.object], instance, first[i])});
    }
  }
  if (!proxy_instances.empty())
    state.proxies = make_proxy_tracer(device, proxies, proxy_instances, config.proxy);
  return tracer;
}

void trace_rays(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps) {
  if (tracer.state->proxies) set_detail(*tracer.state->proxies);
  trace_with_levels(tracer, rays, hits, count, query, steps);
}

void trace_camera(const SceneTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps) {
  if (tracer.state->proxies) set_detail(*tracer.state->proxies, camera, tracer.state->pixels);
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  const Buffer<Ray> rays(tracer.device, pixels);
  const std::size_t squares = std::size_t{(camera.width + 7) / 8} * ((camera.height + 7) / 8);
  tracer.device.kernel("trace_scene", "write_camera_rays").run(squares * 64, kGroup, camera, rays);
  trace_with_levels(tracer, rays, hits, pixels, RayQuery::kNearest, steps);
}

SurfaceSamples sample_surface(const Scene& scene, std::span<const Hit> hits) {
  const std::vector<std::uint32_t> first = first_leaves(scene);
  std::vector<std::vector<std::size_t>> pixels(scene.instances.size());
  for (std::size_t i = 0; i < hits.size(); ++i)
    if (hits[i].leaf != RBVH_NO_LEAF)
      pixels[static_cast<std::size_t>(std::upper_bound(first.begin(), first.end(), hits[i].leaf) -
                                      first.begin()) -
             1]
          .push_back(i);
  std::map<std::uint32_t, std::vector<Vec3f>> normals;  // by object, made when first needed
  SurfaceSamples all;
  all.normals.resize(hits.size());
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    if (pixels[k].empty()) continue;
    const SceneInstance& instance = scene.instances[k];
    const SceneObject& object = scene.objects[instance.object];
    if (object.proxy() != nullptr) {
      for (const std::size_t i : pixels[k])
        all.normals[i] = {hits[i].normal[0], hits[i].normal[1], hits[i].normal[2]};
      continue;
    }
    const Affine to_object = inverse(instance.to_world);
    const auto to_world_normal = [&](const Vec3f& n) {
      return static_cast<Vec3f>(normalized(to_object.transposed(static_cast<Vec3d>(n))));
    };
    std::vector<Hit> own;
    for (const std::size_t i : pixels[k]) {
      own.push_back(hits[i]);
      own.back().leaf -= first[k];
      // Where a level has no layer of normals the geometric one is taken: as the object has it.
      const Vec3d world = {hits[i].normal[0], hits[i].normal[1], hits[i].normal[2]};
      const Vec3f n = static_cast<Vec3f>(normalized(instance.to_world.transposed(world)));
      for (int axis = 0; axis < 3; ++axis) own.back().normal[axis] = n[axis];
    }
    SurfaceSamples samples;
    if (const Scan* scan = object.scan()) {
      if (!normals.contains(instance.object)) normals[instance.object] = shading_normals(*scan);
      samples = sample_surface(*scan, normals[instance.object], own);
    } else {
      samples = sample_surface(*object.level(), own);
    }
    if (!samples.colors.empty() && all.colors.empty()) all.colors.assign(hits.size(), kClay);
    for (std::size_t n = 0; n < pixels[k].size(); ++n) {
      all.normals[pixels[k][n]] = to_world_normal(samples.normals[n]);
      if (!samples.colors.empty()) all.colors[pixels[k][n]] = samples.colors[n];
    }
  }
  return all;
}

const ProxyTracer* proxy_tracer(const SceneTracer& tracer) {
  return tracer.state->proxies ? &*tracer.state->proxies : nullptr;
}

}  // namespace rbvh
