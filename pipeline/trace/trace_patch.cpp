#include "pipeline/trace/trace_patch.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/trace/patch_residency.h"
#include "pipeline/trace/ray_queue.h"

namespace rbvh {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 20;  // rays whose work items are in memory at once
constexpr std::uint32_t kJobRays = 2048;              // of one patch: more are several jobs
constexpr std::size_t kRayGroup = 64, kPacketGroup = 16;
constexpr std::uint32_t kPacket = 16;                        // rays, as in kernels/trace/ray_lanes.h
constexpr std::uint32_t kSquare = 4;                         // pixels a side, as in kernels/trace/ray_queue.h
constexpr std::size_t kLeastScouted = std::size_t{1} << 14;  // fewer rays are faster without scouts
constexpr std::uint32_t kScouts = 16;                        // every so many-th ray is one

class PhaseWatch {
 public:
  PhaseWatch(const Device& device, bool timed) : device_(device), timed_(timed) { lap(); }
  double lap() {
    if (!timed_) return 0;
    device_.finish();
    return watch_.lap();
  }

 private:
  const Device& device_;
  bool timed_;
  Stopwatch watch_;
};

}  // namespace

struct PatchTracerState {
  ProxyConfig config;
  std::string search_options;  ///< -D words of trace_patch.cl and trace_patch_packet.cl
  ProxyStats stats;
  PatchScene scene;
  PatchResidency residency;
  RayQueue queue;
  Buffer<std::uint32_t> limits;  ///< a ray: what its work items share (cast_patches.cl)
  Buffer<Ray> camera_rays;
  RayDetail detail{0, 0};
  bool expects_misses = true;  ///< so many that scouts pay

  // Lists that the device may still be reading when a cast goes on.
  std::vector<PatchBuild> sent_builds;
  std::vector<PatchJob> jobs, sent_jobs;
};

namespace {

using State = PatchTracerState;

/// One cast of a batch of rays.
class Cast {
 public:
  Cast(const Device& device, State& state, const Buffer<Ray>& rays, const Buffer<Hit>& hits, RayRange range,
       bool any, const Buffer<std::uint32_t>* steps)
      : device_(device),
        state_(state),
        rays_(rays),
        hits_(hits),
        range_(range),
        any_(any),
        steps_(steps != nullptr ? *steps : Buffer<std::uint32_t>()) {}

  void run(bool scouts) {
    if (scouts && range_.count >= kLeastScouted) scout();
    state_.stats.rays += range_.count;
    std::uint32_t active = range_.count;
    for (int round = 0; active > 0; ++round) active = cast_round(round, active);
  }

 private:
  /// A few of the rays find the patches that come first. Those are built before the others are cast, which
  /// then need not become work items.
  void scout() {
    PhaseWatch watch(device_, state_.stats.timed);
    RayRange few = range_;
    few.stride = kScouts;
    few.row = 0;
    const std::uint32_t items = search(0, few, range_.count / kScouts, 1, false, false).items;
    state_.stats.top += watch.lap();
    read_keys(state_.queue, items);
    std::vector<std::uint32_t>& keys = state_.queue.host_keys;
    std::sort(keys.begin(), keys.end());
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    for (const std::uint32_t target : keys)
      if (!provide(device_, state_.residency, patch_of(instance_of(state_.scene, target), target))) break;
    state_.stats.sort += watch.lap();
    flush(watch);
  }

  static std::uint32_t patch_of(const PatchInstance& placed, std::uint32_t target) {
    return placed.first_patch + (target - placed.first_target);
  }

  /// In round 0 the rays of `range` begin, in later ones those go on that the round before has left: at most
  /// `active` in either case.
  RoundCounts search(int round, const RayRange& range, std::uint32_t active, std::uint32_t most, bool at_once,
                     bool packets) {
    RayQueue& queue = state_.queue;
    const PatchScene& scene = state_.scene;
    upload_slots(state_.residency);
    const PatchSearch scalars = {scene.top,         range, active, state_.detail, any_ ? 1u : 0u,
                                 at_once ? 1u : 0u, most};
    const Kernel kernel =
        packets ? device_.kernel("trace/trace_patch_packet", "search_patches_packet", state_.search_options)
                : device_.kernel("trace/trace_patch", "search_patches", state_.search_options);
    kernel.run(packets ? (active + kPacket - 1) / kPacket : active, packets ? kPacketGroup : kRayGroup,
               scalars, scene.nodes, scene.device_instances, scene.device_patches, scene.device_parts,
               state_.residency.device_slots, state_.residency.memory, scene.links, rays_,
               active_rays(queue, round), queue.keys, queue.places, queue.items, queue.listed,
               round_counts(queue, round), queue.progress, hits_, steps_);
    const RoundCounts counts = read_counts(queue, round);
    has_sent_ = false;
    return counts;
  }

  /// Returns how many rays go on, at most.
  std::uint32_t cast_round(int round, std::uint32_t active) {
    PhaseWatch watch(device_, state_.stats.timed);
    const std::uint32_t most = items_per_ray(state_.queue, round, active, state_.config.items);
    const bool at_once = state_.config.at_once,
               packets = state_.config.packets && at_once && device_.info().is_cpu;
    const RoundCounts counts = search(round, range_, active, most, at_once, packets);
    state_.stats.top += watch.lap();
    if (round == 0 || counts.active > 0) ++state_.stats.rounds;
    if (counts.items == 0) return 0;
    state_.stats.items += counts.items;
    sort_items(device_, state_.queue, counts.items, bits_for(state_.scene.targets));
    state_.stats.sort += watch.lap();
    cast_items(watch);
    const std::uint32_t going_on =
        take_nearest(device_, state_.queue, round, counts.listed, any_, state_.limits, hits_, steps_);
    state_.stats.cast += watch.lap();
    return going_on;
  }

  /// Builds what is missing and casts the sorted work items, as many patches at a time as the cache holds.
  void cast_items(PhaseWatch& watch) {
    const std::vector<std::uint32_t>& keys = state_.queue.host_keys;
    const auto count = static_cast<std::uint32_t>(keys.size());
    for (std::uint32_t first = 0, end = 0; first < count; first = end) {
      end = end_of_run(keys, first);
      const PatchInstance& placed = instance_of(state_.scene, keys[first]);
      const std::uint32_t patch = patch_of(placed, keys[first]);
      const bool built = build_for(patch, end - first, watch);
      if (!built) state_.stats.unbuilt_rays += end - first;
      const PatchLevel& wanted = state_.residency.wanted[patch];
      const PatchSlot slot = built ? state_.residency.slots[patch] : PatchSlot{PATCH_NOT_BUILT, wanted.level};
      const auto instance = static_cast<std::uint32_t>(&placed - state_.scene.instances.data());
      for (std::uint32_t begin = first; begin < end; begin += kJobRays)
        state_.jobs.push_back(
            {begin, std::min(begin + kJobRays, end), instance, patch, slot, packed_edges(wanted), 0});
    }
    flush(watch);
  }

  /// False where the rays are to be cast at the patch as it is.
  bool build_for(std::uint32_t patch, std::uint32_t rays, PhaseWatch& watch) {
    PatchResidency& residency = state_.residency;
    if (does_without(state_.scene, residency, patch, rays, state_.config.few_rays)) return false;
    if (provide(device_, residency, patch)) return true;
    flush(watch);
    if (provide(device_, residency, patch)) return true;
    if (can_do_without(state_.scene, residency, patch)) return false;
    device_.finish();  // it may still be reading what an exception frees
    throw Error(ErrorKind::kBudget, {},
                "a patch of " + std::to_string(1u << residency.wanted[patch].level) +
                    " micro-quads a side needs " +
                    std::to_string(std::size_t{blocks_of(device_, residency, patch)} * sizeof(PatchBlock)) +
                    " bytes, more than the patch cache has; make that larger");
  }

  void flush(PhaseWatch& watch) {
    if (has_sent_) device_.finish();
    has_sent_ = true;
    state_.sent_builds.swap(state_.residency.builds);
    state_.sent_jobs.swap(state_.jobs);
    state_.residency.builds.clear();
    state_.jobs.clear();
    if (!state_.sent_builds.empty()) {
      run_builds(state_.sent_builds);
      state_.stats.build += watch.lap();
    }
    if (!state_.sent_jobs.empty()) {
      run_jobs(state_.sent_jobs);
      state_.stats.cast += watch.lap();
    }
    state_.stats.evicted += std::exchange(state_.residency.evicted, 0);
    std::fill(state_.residency.needed.begin(), state_.residency.needed.end(), 0);
  }

  void run_builds(const std::vector<PatchBuild>& list) {
    Buffer<PatchBuild> builds(device_, list.size());
    builds.enqueue_write(list);
    next_job_.fill(0);
    device_.kernel("build/build_patches", "build_patches", group_options(device_))
        .run(queue_items(device_, list.size()), group_size(device_), state_.scene.device_patches,
             state_.scene.map, builds, static_cast<std::uint32_t>(list.size()), next_job_,
             state_.residency.memory);
    ProxyStats& stats = state_.stats;
    for (const PatchBuild& build : list) {
      stats.built_leaves += std::uint64_t{1} << 2 * build.level;
      stats.built_bytes +=
          std::uint64_t{blocks_of(device_, state_.residency, build.patch)} * sizeof(PatchBlock);
    }
    stats.built += list.size();
  }

  void run_jobs(const std::vector<PatchJob>& list) {
    Buffer<PatchJob> jobs(device_, list.size());
    jobs.enqueue_write(list);
    next_job_.fill(0);
    const PatchCast scalars = {static_cast<std::uint32_t>(list.size()), any_ ? 1u : 0u, state_.detail};
    const PatchScene& scene = state_.scene;
    const RayQueue& queue = state_.queue;
    device_.kernel("trace/cast_patches", "cast_patches", group_options(device_))
        .run(queue_items(device_, list.size()), group_size(device_), scalars, jobs, next_job_,
             scene.device_instances, scene.device_patches, scene.device_parts, scene.map,
             state_.residency.memory, scene.links, queue.places, queue.items, rays_, hits_, queue.item_hits,
             steps_.size() > 0 ? queue.item_steps : Buffer<std::uint32_t>(), state_.limits);
    state_.stats.jobs += list.size();
  }

  const Device& device_;
  State& state_;
  const Buffer<Ray>& rays_;
  const Buffer<Hit>& hits_;
  RayRange range_;
  bool any_;
  Buffer<std::uint32_t> steps_;
  Buffer<std::uint32_t> next_job_{device_, 1};
  bool has_sent_ = false;  ///< lists that the device may still be reading
};

void reserve(const Device& device, State& state, std::size_t rays) {
  reserve_queue(device, state.queue, rays, kBatch);
  if (rays <= state.limits.size()) return;
  state.limits = {device, rays};
  state.limits.fill(0xff);
}

void miss_all(Buffer<Hit> hits, std::size_t count, const Buffer<std::uint32_t>* steps) {
  Hit none{};
  none.t = std::numeric_limits<float>::infinity();
  none.leaf = RBVH_NO_LEAF;
  hits.write(std::vector<Hit>(count, none));
  if (steps != nullptr) Buffer<std::uint32_t>(*steps).write(std::vector<std::uint32_t>(count, 0));
}

void trace(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
           RayQuery query, const Buffer<std::uint32_t>* steps, bool keep_hits, std::uint32_t row) {
  State& state = *tracer.state;
  RBVH_CHECK(rays.size() >= count && hits.size() >= count && (steps == nullptr || steps->size() >= count));
  if (count == 0) return;
  if (state.scene.instances.empty()) {
    if (!keep_hits) miss_all(hits, count, steps);
    return;
  }
  if (!state.config.keep) clear_cache(tracer);
  reserve(tracer.device, state, count);
  const bool scouts = state.config.at_once && state.expects_misses;
  const std::uint64_t items_before = state.stats.items;
  if (row >= kBatch / kSquare) row = 0;
  // Batches are whole rows of squares.
  const std::size_t rows = std::size_t{kSquare} * row, batch = row > 0 ? kBatch / rows * rows : kBatch;
  for (std::size_t first = 0; first < count; first += batch) {
    const RayRange range = {static_cast<std::uint32_t>(first),
                            static_cast<std::uint32_t>(std::min(batch, count - first)), 1, row,
                            keep_hits ? 1u : 0u};
    Cast(tracer.device, state, rays, hits, range, query == RayQuery::kAny, steps).run(scouts);
  }
  state.expects_misses = (state.stats.items - items_before) * kScouts > count;
}

void set_wanted(State& state, std::span<const std::uint32_t> levels) {
  const bool lost = set_levels(state.residency, state.scene, levels);
  state.expects_misses = state.expects_misses || lost;
}

}  // namespace

PatchTracer make_patch_tracer(const Device& device, std::span<const Proxy* const> proxies,
                              std::span<const ProxyInstance> instances, const ProxyConfig& config) {
  PatchTracer tracer(device);
  tracer.state = std::make_shared<PatchTracerState>();
  State& state = *tracer.state;
  state.config = config;
  state.config.items = std::clamp(config.items, 1u, kMostItems);
  state.scene = upload_patches(device, proxies, instances);
  state.residency = make_residency(device, state.scene, config.cache_bytes);
  state.search_options = group_options(device) +
                         " -DSTACK=" + std::to_string((state.scene.stack + 63) / 64 * 64) +
                         " -DMOST=" + std::to_string(kMostItems);
  set_detail(tracer);
  return tracer;
}

PatchTracer make_patch_tracer(const Device& device, const Proxy& proxy, const ProxyConfig& config) {
  const Proxy* const one = &proxy;
  const ProxyInstance instance;
  return make_patch_tracer(device, std::span(&one, 1), std::span(&instance, 1), config);
}

void set_detail(const PatchTracer& tracer, const CameraRays& camera, double pixels) {
  State& state = *tracer.state;
  set_wanted(state, levels_for(state.scene, camera, pixels));
  const Vec3d right = {camera.right[0], camera.right[1], camera.right[2]};
  state.detail = {0, static_cast<float>(pixels * length(right))};
}

void set_detail(const PatchTracer& tracer, std::uint32_t most) {
  State& state = *tracer.state;
  std::vector<std::uint32_t> levels;
  for (const Patch& patch : state.scene.patches)
    levels.push_back(std::min(patch.level, std::max(most, kLeastPatchLevel)));
  set_wanted(state, levels);
  state.detail = {0, 0};
}

void resolve_everything(const PatchTracer& tracer) { tracer.state->detail = {0, 0}; }

std::vector<PatchLevel> levels_in_use(const PatchTracer& tracer, std::uint32_t proxy) {
  const State& state = *tracer.state;
  const PatchScene::Mesh& mesh = state.scene.meshes.at(proxy);
  const auto first = state.residency.wanted.begin() + mesh.first_patch;
  return {first, first + mesh.patches};
}

void PatchTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                            RayQuery query, const Buffer<std::uint32_t>* steps) const {
  intersect_rows(*this, rays, hits, count, query, steps, 0);
}

void PatchTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                            const Buffer<std::uint32_t>* steps) const {
  set_detail(*this, camera);
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  Buffer<Ray>& rays = state->camera_rays;
  if (rays.size() < pixels) rays = {device, pixels};
  const std::size_t squares = std::size_t{(camera.width + 7) / 8} * ((camera.height + 7) / 8);
  device.kernel("trace/camera_rays", "write_camera_rays").run(squares * 64, kRayGroup, camera, rays);
  intersect_rows(*this, rays, hits, pixels, RayQuery::kNearest, steps, camera.width);
}

std::uint64_t PatchTracer::memory() const {
  const ProxyBytes b = bytes(*this);
  return b.base + b.maps + b.cache;
}

void intersect_rows(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                    std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps,
                    std::uint32_t row) {
  trace(tracer, rays, hits, count, query, steps, false, row);
}

void intersect_further(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                       std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps,
                       std::uint32_t row) {
  trace(tracer, rays, hits, count, query, steps, true, row);
}

ProxyStats& stats(const PatchTracer& tracer) { return tracer.state->stats; }

ProxyBytes bytes(const PatchTracer& tracer) {
  const State& state = *tracer.state;
  const PatchScene& scene = state.scene;
  ProxyBytes b;
  b.base = scene.nodes.size() * sizeof(WideNode) + scene.instances.size() * sizeof(PatchInstance) +
           scene.patches.size() * (sizeof(Patch) + sizeof(PatchParts) + sizeof(PatchSlot)) +
           scene.links.size() * sizeof(std::uint32_t);
  b.maps = scene.map_texels * 3 * sizeof(float);
  b.cache = state.residency.memory.size() * sizeof(PatchBlock);
  b.cached = state.residency.cache.used() * sizeof(PatchBlock);
  return b;
}

void clear_cache(const PatchTracer& tracer) {
  clear(tracer.state->residency);
  tracer.state->expects_misses = true;
}

}  // namespace rbvh
