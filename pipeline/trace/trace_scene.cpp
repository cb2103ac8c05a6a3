#include "pipeline/trace/trace_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <variant>

#include "kernels/common/scene_layout.h"
#include "pipeline/base/error.h"
#include "pipeline/bvh/wide_bvh.h"
#include "pipeline/device/radix_sort.h"

namespace rbvh {

struct SceneTracerState {
  std::vector<std::variant<TileTracer, ExactTracer>> tracers;  ///< one for each object that is no proxy
  std::optional<PatchTracer> proxies;
  double pixels = 1;

  // Instances that are no proxies, and the hierarchy over them.
  std::size_t placed = 0;
  std::string options;  ///< -D words of trace_scene.cl
  BvhRoot top{};
  Buffer<WideNode> nodes;
  Buffer<ScenePlacement> placements;

  // Scratch, for as many rays as the largest batch so far.
  std::size_t progress_rays = 0, batch_rays = 0;
  Buffer<RayProgress> progress;
  Buffer<std::uint32_t> active[2], pair_keys, pair_rays, pair_instances, pair_places, pair_ranges, pair_steps,
      placed_steps, count;
  Buffer<Ray> camera_rays, placed_rays;
  Buffer<Hit> placed_hits, pair_hits;
};

namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kBatch = std::size_t{1} << 18;  // rays whose pairs are in memory at once
constexpr std::size_t kLeastPairs = std::size_t{1} << 16;
constexpr std::uint32_t kMostOfRay = 16;  // pairs a ray and round

ScenePlacement place(const Bounds3f& box, const SceneInstance& instance, std::uint32_t first_leaf,
                     std::uint32_t tracer) {
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
  placement.tracer = tracer;
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
  if (rays > state.progress_rays) {
    state.progress_rays = rays;
    state.progress = {device, rays};
  }
  const std::size_t batch = std::min(rays, kBatch), pairs = std::max(batch, kLeastPairs);
  if (batch <= state.batch_rays) return;
  state.batch_rays = batch;
  for (Buffer<std::uint32_t>& list : state.active) list = {device, batch};
  for (Buffer<std::uint32_t>* list : {&state.pair_keys, &state.pair_rays, &state.pair_instances,
                                      &state.pair_places, &state.pair_steps, &state.placed_steps})
    *list = {device, pairs};
  state.pair_ranges = {device, 2 * batch};
  state.count = {device, 1};
  state.placed_rays = {device, pairs};
  state.placed_hits = {device, pairs};
  state.pair_hits = {device, pairs};
}

std::uint32_t read_count(const Buffer<std::uint32_t>& count) {
  std::uint32_t value = 0;
  count.read(std::span(&value, 1));
  return value;
}

/// Sorted pairs [begin, end) of one tracer.
void trace_pairs(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                 std::uint32_t number, std::uint32_t begin, std::uint32_t end, RayQuery query,
                 bool has_steps) {
  const SceneTracerState& state = *tracer.state;
  const std::uint32_t count = end - begin;
  tracer.device.kernel("trace/trace_scene", "place_rays", state.options)
      .run(count, kGroup, state.pair_places, begin, count, state.pair_rays, state.pair_instances,
           state.placements, rays, hits, state.placed_rays);
  std::visit(
      [&](const auto& kind) {
        trace_rays(kind, state.placed_rays, state.placed_hits, count, query,
                   has_steps ? &state.placed_steps : nullptr);
      },
      state.tracers[number]);
  tracer.device.kernel("trace/trace_scene", "take_placed_hits", state.options)
      .run(count, kGroup, state.pair_places, begin, count, state.pair_rays, state.pair_instances,
           state.placements, rays, state.placed_hits, state.placed_steps, state.pair_hits,
           has_steps ? state.pair_steps : Buffer<std::uint32_t>());
}

/// Rays [first, first + count) and all instances that are no proxies.
void trace_placed(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                  std::uint32_t first, std::uint32_t count, RayQuery query,
                  const Buffer<std::uint32_t>& steps) {
  SceneTracerState& state = *tracer.state;
  const Device& device = tracer.device;
  const bool has_steps = steps.size() > 0;
  device.kernel("trace/trace_scene", "start_placing", state.options)
      .run(count, kGroup, hits, state.progress, state.active[0], first, count, steps);
  unsigned key_bits = 0;
  while (state.tracers.size() > std::size_t{1} << key_bits) ++key_bits;
  std::uint32_t active = count;
  for (int round = 0; active > 0; ++round) {
    const Buffer<std::uint32_t>&list = state.active[round % 2], &next = state.active[(round + 1) % 2];
    // Many rays hit what they meet first; those that do not soon want all.
    const auto room = static_cast<std::uint32_t>(std::max<std::size_t>(1, state.pair_keys.size() / active));
    const std::uint32_t most = std::min({kMostOfRay, 1u << std::min(2 * round, 8), room});
    state.count.fill(0);
    device.kernel("trace/trace_scene", "intersect_instances", state.options)
        .run(active, kGroup, state.nodes, state.top, state.placements, rays, list, active, most, hits,
             state.progress, state.pair_keys, state.pair_rays, state.pair_instances, state.pair_places,
             state.pair_ranges, state.count, steps);
    const std::uint32_t pairs = read_count(state.count);
    if (pairs == 0) return;
    if (key_bits == 0) {
      trace_pairs(tracer, rays, hits, 0, 0, pairs, query, has_steps);
    } else {
      radix_sort(device, state.pair_keys, state.pair_places, pairs, key_bits);
      std::vector<std::uint32_t> keys(pairs);
      state.pair_keys.read(keys);
      for (std::uint32_t begin = 0, end = 0; begin < pairs; begin = end) {
        end = static_cast<std::uint32_t>(std::upper_bound(keys.begin() + begin, keys.end(), keys[begin]) -
                                         keys.begin());
        trace_pairs(tracer, rays, hits, keys[begin], begin, end, query, has_steps);
      }
    }
    state.count.fill(0);
    device.kernel("trace/trace_scene", "take_nearest", state.options)
        .run(active, kGroup, list, active, query == RayQuery::kAny ? 1u : 0u, state.pair_ranges,
             state.pair_hits, state.pair_steps, state.progress, hits, next, state.count, steps);
    active = read_count(state.count);
  }
}

void trace_with_levels(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                       std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps,
                       std::uint32_t row) {
  SceneTracerState& state = *tracer.state;
  RBVH_CHECK(rays.size() >= count && hits.size() >= count && (steps == nullptr || steps->size() >= count));
  if (state.placed > 0) {
    grow_scratch(tracer.device, state, count);
    for (std::size_t first = 0; first < count; first += kBatch)
      trace_placed(tracer, rays, hits, static_cast<std::uint32_t>(first),
                   static_cast<std::uint32_t>(std::min(kBatch, count - first)), query,
                   steps != nullptr ? *steps : Buffer<std::uint32_t>());
  }
  if (state.proxies) {
    state.placed > 0 ? trace_rays_further(*state.proxies, rays, hits, count, query, steps, row)
                     : trace_rays(*state.proxies, rays, hits, count, query, steps, row);
  }
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
      state.tracers.emplace_back(make_tile_tracer(device, *level));
    else
      state.tracers.emplace_back(make_exact_tracer(device, *object.scan(), config.exact));
  }
  std::vector<ProxyInstance> proxy_instances;
  std::vector<ScenePlacement> placements;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const SceneInstance& instance = scene.instances[i];
    const SceneObject& object = scene.objects[instance.object];
    if (object.proxy() != nullptr) {
      proxy_instances.push_back({number[instance.object], instance.to_world, first[i]});
    } else {
      placements.push_back(place(boxes[instance.object], instance, first[i], number[instance.object]));
    }
  }
  if (!placements.empty()) {
    std::vector<Bounds3f> placed_boxes;
    for (const ScenePlacement& p : placements)
      placed_boxes.push_back({{p.lo[0], p.lo[1], p.lo[2]}, {p.hi[0], p.hi[1], p.hi[2]}});
    const WideBvh wide = build_wide_bvh(placed_boxes);
    state.placed = placements.size();
    state.top = wide.scene;
    state.nodes = {device, wide.nodes};
    state.placements = {device, placements};
    state.options =
        "-DSTACK=" + std::to_string((wide.stack + 63) / 64 * 64) + " -DMOST=" + std::to_string(kMostOfRay);
  }
  if (!proxy_instances.empty() || placements.empty())
    state.proxies = make_patch_tracer(device, proxies, proxy_instances, config.proxy);
  return tracer;
}

void trace_rays(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps) {
  if (tracer.state->proxies) set_detail(*tracer.state->proxies);
  trace_with_levels(tracer, rays, hits, count, query, steps, 0);
}

void trace_camera(const SceneTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps) {
  if (tracer.state->proxies) set_detail(*tracer.state->proxies, camera, tracer.state->pixels);
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  Buffer<Ray>& rays = tracer.state->camera_rays;
  if (rays.size() < pixels) rays = {tracer.device, pixels};
  const std::size_t squares = std::size_t{(camera.width + 7) / 8} * ((camera.height + 7) / 8);
  tracer.device.kernel("trace/trace_scene", "write_camera_rays", tracer.state->options)
      .run(squares * 64, kGroup, camera, rays);
  trace_with_levels(tracer, rays, hits, pixels, RayQuery::kNearest, steps, camera.width);
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

const PatchTracer* patch_tracer(const SceneTracer& tracer) {
  return tracer.state->proxies ? &*tracer.state->proxies : nullptr;
}

}  // namespace rbvh
