#include "pipeline/trace/trace_scene.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/common/scene_layout.h"
#include "pipeline/base/error.h"
#include "pipeline/bvh/wide_bvh.h"
#include "pipeline/trace/level_residency.h"
#include "pipeline/trace/ray_queue.h"
#include "pipeline/trace/surface.h"

namespace rbvh {

struct SceneTracerState {
  const Scene* scene = nullptr;
  std::vector<std::uint32_t> first_leaf;         ///< of each instance, and the number of all
  std::vector<std::uint32_t> number;             ///< of each object among the tracers, or among the proxies
  std::vector<std::unique_ptr<Tracer>> tracers;  ///< one for each object that is no proxy; none: on demand
  std::vector<std::uint32_t> objects;            ///< of each of these
  std::optional<LevelResidency> on_demand;
  std::optional<PatchTracer> proxies;
  double pixels = 1;

  // Instances that are no proxies, and the hierarchy over them.
  std::size_t placed = 0;
  std::string options;  ///< -D words of trace_scene.cl
  BvhRoot top{};
  Buffer<WideNode> nodes;
  Buffer<ScenePlacement> placements;

  // Rays of a round, and those of one tracer in its object's space.
  RayQueue queue;
  Buffer<Ray> camera_rays, placed_rays;
  Buffer<Hit> placed_hits;
  Buffer<std::uint32_t> placed_steps;

  /// To cast rays at.
  bool is_there(std::uint32_t at) const {
    return tracers[at] != nullptr || on_demand->has_tracer(objects[at]);
  }
  /// To ask about hits.
  bool has_surface(std::uint32_t at) const {
    return tracers[at] != nullptr || on_demand->has_level(objects[at]);
  }
  const Tracer& tracer(std::uint32_t at) {
    return tracers[at] != nullptr ? *tracers[at] : on_demand->tracer_of(objects[at]);
  }
  SurfaceSamples surface(std::uint32_t at, std::span<const Hit> hits, float spread) {
    return tracers[at] != nullptr ? tracers[at]->surface(hits, spread)
                                  : sample_surface(on_demand->level_of(objects[at]), hits, spread);
  }
};

namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kBatch = std::size_t{1} << 18;  // rays whose work items are in memory at once
constexpr std::uint32_t kMostOfRay = 16;              // work items a ray and round

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

/// The box of what rays can hit: a cloud's discs and a level's tiles reach past the object's bounds.
Bounds3f traced_bounds(const SceneObject& object) {
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

void reserve(const Device& device, SceneTracerState& state, std::size_t rays) {
  if (!reserve_queue(device, state.queue, rays, kBatch)) return;
  const std::size_t items = state.queue.items.size();
  state.placed_rays = {device, items};
  state.placed_hits = {device, items};
  state.placed_steps = {device, items};
}

/// Sorted work items [begin, end) of one tracer.
void trace_items(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                 std::uint32_t number, std::uint32_t begin, std::uint32_t end, RayQuery query,
                 bool has_steps) {
  SceneTracerState& state = *tracer.state;
  const RayQueue& queue = state.queue;
  const std::uint32_t count = end - begin;
  tracer.device.kernel("trace/trace_scene", "place_rays", state.options)
      .run(count, kGroup, queue.places, begin, count, queue.items, state.placements, rays, hits,
           state.placed_rays);
  state.tracer(number).intersect(state.placed_rays, state.placed_hits, count, query,
                                 has_steps ? &state.placed_steps : nullptr);
  tracer.device.kernel("trace/trace_scene", "collect_hits", state.options)
      .run(count, kGroup, queue.places, begin, count, queue.items, state.placements, rays, state.placed_hits,
           state.placed_steps, queue.item_hits, has_steps ? queue.item_steps : Buffer<std::uint32_t>());
}

/// Rays of the range and all instances that are no proxies.
void trace_placed(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                  const RayRange& range, RayQuery query, const Buffer<std::uint32_t>& steps) {
  SceneTracerState& state = *tracer.state;
  const Device& device = tracer.device;
  RayQueue& queue = state.queue;
  std::uint32_t active = range.count;
  for (int round = 0; active > 0; ++round) {
    const SceneSearch search = {state.top, range, active, items_per_ray(queue, round, active, kMostOfRay)};
    device.kernel("trace/trace_scene", "search_instances", state.options)
        .run(active, kGroup, search, state.nodes, state.placements, rays, active_rays(queue, round),
             queue.keys, queue.places, queue.items, queue.listed, round_counts(queue, round), queue.progress,
             hits, steps);
    const RoundCounts counts = read_counts(queue, round);
    if (counts.items == 0) return;
    sort_items(device, queue, counts.items, bits_for(state.tracers.size()));
    struct Run {
      std::uint32_t number, begin, end;
    };
    std::vector<Run> runs;
    for (std::uint32_t begin = 0; begin < counts.items; begin = runs.back().end)
      runs.push_back({queue.host_keys[begin], begin, end_of_run(queue.host_keys, begin)});
    // First those that are there: in one order round for round, each would leave just before its next use.
    std::stable_partition(runs.begin(), runs.end(),
                          [&](const Run& run) { return state.is_there(run.number); });
    for (const auto& [number, begin, end] : runs)
      trace_items(tracer, rays, hits, number, begin, end, query, steps.size() > 0);
    active = take_nearest(device, queue, round, counts.listed, query == RayQuery::kAny, {}, hits, steps);
  }
}

void trace_with_levels(const SceneTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                       std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps,
                       std::uint32_t row) {
  SceneTracerState& state = *tracer.state;
  RBVH_CHECK(rays.size() >= count && hits.size() >= count && (steps == nullptr || steps->size() >= count));
  if (state.placed > 0) {
    reserve(tracer.device, state, count);
    for (std::size_t first = 0; first < count; first += kBatch) {
      const RayRange range = {static_cast<std::uint32_t>(first),
                              static_cast<std::uint32_t>(std::min(kBatch, count - first)), 1, 0, 0};
      trace_placed(tracer, rays, hits, range, query, steps != nullptr ? *steps : Buffer<std::uint32_t>());
    }
  }
  if (state.proxies) {
    state.placed > 0 ? intersect_further(*state.proxies, rays, hits, count, query, steps, row)
                     : intersect_rows(*state.proxies, rays, hits, count, query, steps, row);
  }
}

}  // namespace

SceneTracer make_scene_tracer(const Device& device, const Scene& scene, const SceneConfig& config) {
  SceneTracer tracer(device);
  tracer.state = std::make_shared<SceneTracerState>();
  SceneTracerState& state = *tracer.state;
  state.pixels = config.pixels;
  state.scene = &scene;
  state.first_leaf = first_leaves(scene);
  const std::vector<std::uint32_t>& first = state.first_leaf;
  std::vector<std::uint32_t>& number = state.number;
  std::vector<const Proxy*> proxies;
  std::vector<Bounds3f> boxes;
  for (const SceneObject& object : scene.objects) {
    boxes.push_back(traced_bounds(object));
    if (const Proxy* proxy = object.proxy()) {
      number.push_back(static_cast<std::uint32_t>(proxies.size()));
      proxies.push_back(proxy);
      continue;
    }
    number.push_back(static_cast<std::uint32_t>(state.tracers.size()));
    state.objects.push_back(static_cast<std::uint32_t>(number.size() - 1));
    if (object.on_demand() != nullptr) {
      if (!state.on_demand) state.on_demand.emplace(device, scene);
      state.tracers.push_back(nullptr);
    } else if (const Level* level = object.level())
      state.tracers.push_back(std::make_unique<TileTracer>(make_tile_tracer(device, *level)));
    else
      state.tracers.push_back(
          std::make_unique<ExactTracer>(make_exact_tracer(device, *object.scan(), config.exact)));
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
    placed_boxes.reserve(placements.size());
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

void SceneTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                            RayQuery query, const Buffer<std::uint32_t>* steps) const {
  if (state->proxies) set_detail(*state->proxies);
  trace_with_levels(*this, rays, hits, count, query, steps, 0);
}

void SceneTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                            const Buffer<std::uint32_t>* steps) const {
  if (state->proxies) set_detail(*state->proxies, camera, state->pixels);
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  Buffer<Ray>& rays = state->camera_rays;
  if (rays.size() < pixels) rays = {device, pixels};
  const std::size_t squares = std::size_t{(camera.width + 7) / 8} * ((camera.height + 7) / 8);
  device.kernel("trace/camera_rays", "write_camera_rays").run(squares * 64, kGroup, camera, rays);
  trace_with_levels(*this, rays, hits, pixels, RayQuery::kNearest, steps, camera.width);
}

SurfaceSamples SceneTracer::surface(std::span<const Hit> hits, float spread) const {
  const Scene& scene = *state->scene;
  const std::vector<std::uint32_t>& first = state->first_leaf;
  std::vector<std::vector<std::size_t>> pixels(scene.instances.size());
  for (std::size_t i = 0; i < hits.size(); ++i)
    if (hits[i].leaf != RBVH_NO_LEAF)
      pixels[static_cast<std::size_t>(std::upper_bound(first.begin(), first.end(), hits[i].leaf) -
                                      first.begin()) -
             1]
          .push_back(i);
  SurfaceSamples all;
  all.normals.resize(hits.size());
  std::vector<std::size_t> order;  // first those that are there
  order.reserve(pixels.size());
  for (std::size_t k = 0; k < pixels.size(); ++k)
    if (!pixels[k].empty()) order.push_back(k);
  std::stable_partition(order.begin(), order.end(), [&](std::size_t k) {
    const std::uint32_t object = scene.instances[k].object;
    return scene.objects[object].proxy() != nullptr || state->has_surface(state->number[object]);
  });
  for (const std::size_t k : order) {
    const SceneInstance& instance = scene.instances[k];
    if (scene.objects[instance.object].proxy() != nullptr) {
      for (const std::size_t i : pixels[k])
        all.normals[i] = {hits[i].normal[0], hits[i].normal[1], hits[i].normal[2]};
      continue;
    }
    const Affine to_object = inverse(instance.to_world);
    const auto to_world_normal = [&](const Vec3f& n) {
      return static_cast<Vec3f>(normalized(to_object.transposed(static_cast<Vec3d>(n))));
    };
    const auto own_spread = spread * static_cast<float>(std::cbrt(std::abs(to_object.determinant())));
    std::vector<Hit> own;
    for (const std::size_t i : pixels[k]) {
      own.push_back(hits[i]);
      own.back().leaf -= first[k];
      // Where a level has no layer of normals the geometric one is taken: as the object has it.
      const Vec3d world = {hits[i].normal[0], hits[i].normal[1], hits[i].normal[2]};
      const Vec3f n = static_cast<Vec3f>(normalized(instance.to_world.transposed(world)));
      for (int axis = 0; axis < 3; ++axis) own.back().normal[axis] = n[axis];
    }
    const SurfaceSamples samples = state->surface(state->number[instance.object], own, own_spread);
    if (!samples.colors.empty() && all.colors.empty()) all.colors.assign(hits.size(), kClay);
    for (std::size_t n = 0; n < pixels[k].size(); ++n) {
      all.normals[pixels[k][n]] = to_world_normal(samples.normals[n]);
      if (!samples.colors.empty()) all.colors[pixels[k][n]] = samples.colors[n];
    }
  }
  return all;
}

bool SceneTracer::is_on_demand() const { return state->on_demand.has_value(); }

std::uint64_t SceneTracer::memory() const {
  std::uint64_t total = state->nodes.size_bytes() + state->placements.size_bytes();
  for (const std::unique_ptr<Tracer>& tracer : state->tracers)
    if (tracer != nullptr) total += tracer->memory();
  if (state->on_demand) total += state->on_demand->bytes();
  if (state->proxies) total += state->proxies->memory();
  return total;
}

const PatchTracer* patch_tracer(const SceneTracer& tracer) {
  return tracer.state->proxies ? &*tracer.state->proxies : nullptr;
}

}  // namespace rbvh
