#include "pipeline/trace/trace_patch.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "kernels/common/scene_layout.h"
#include "pipeline/base/error.h"
#include "pipeline/bvh/wide_bvh.h"
#include "pipeline/device/radix_sort.h"
#include "pipeline/trace/patch_cache.h"

namespace rbvh {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 20;  // rays whose pairs are in memory at once
constexpr std::size_t kLeastPairs = std::size_t{1} << 16;
constexpr std::uint32_t kFewPairs = 4096;        // are sorted here rather than by a dozen kernels
constexpr std::uint32_t kJobRays = 2048;         // of one patch: more are several jobs
constexpr std::uint32_t kLeastLevel = 2;         // 16 micro-quads cost as much as one
constexpr std::uint32_t kLeastUnbuiltLevel = 4;  // coarser ones are built as fast as met
constexpr std::size_t kGpuGroup = 64, kRayGroup = 64, kPacketGroup = 16;
constexpr std::uint32_t kPacket = 16;  // rays, as in kernels/trace/patch_packet.h
constexpr std::uint32_t kSquare = 4;   // pixels a side, as in trace_proxy.cl
constexpr std::uint32_t kCpuGroupsPerUnit = 4;
constexpr std::size_t kLeastScouted = std::size_t{1} << 14;  // fewer rays are faster gathered
constexpr std::uint32_t kScouts = 16;                        // every so many-th ray is one

/// Blocks and vertices. `wide`: as a CPU has them (kernels/trace/patch_surface.h).
std::uint32_t slot_blocks(std::uint32_t level, bool wide) {
  const bool has_grids = wide && level >= 2;
  const std::uint32_t boxes = has_grids ? level - 1 : level;
  const std::uint32_t blocks =
      boxes == 0 ? 1 : static_cast<std::uint32_t>(((std::uint64_t{4} << 2 * boxes) + 32) / 48);
  if (has_grids) return blocks + (1u << 2 * (level - 2));
  const std::size_t side = (std::size_t{1} << level) + 1;
  const std::size_t floats = 3 * side * side + 2;  // kernels read a little more than the last one
  return blocks +
         static_cast<std::uint32_t>((floats * sizeof(float) + sizeof(PatchBlock) - 1) / sizeof(PatchBlock));
}

/// Of every node down to PATCH_LINKED_LEVEL: its first child and the node to go on with when it is passed by.
std::vector<std::uint32_t> make_links() {
  constexpr std::uint32_t kNodes = ((1u << 2 * (PATCH_LINKED_LEVEL + 1)) - 1) / 3, kEnd = 0xffff;
  std::vector<std::uint32_t> links(kNodes);
  for (std::uint32_t node = 0; node < kNodes; ++node) {
    std::uint32_t up = node;
    while (up != 0 && up % 4 == 0) up = (up - 1) / 4;
    const std::uint32_t skip = up == 0 ? kEnd : up + 1, child = 4 * node + 1;
    links[node] = (child < kNodes ? child : 0) << 16 | skip;
  }
  return links;
}

std::uint32_t packed(const std::array<std::uint32_t, 4>& edges) {
  return edges[0] | edges[1] << 8 | edges[2] << 16 | edges[3] << 24;
}

class PhaseWatch {
 public:
  PhaseWatch(const Device& device, bool timed) : device_(device), timed_(timed) { lap(); }
  double lap() {
    if (!timed_) return 0;
    device_.finish();
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  const Device& device_;
  bool timed_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace

struct PatchTracerState {
  ProxyConfig config;
  std::string options;  ///< -D words of trace_proxy.cl
  ProxyStats stats;

  // The scene.
  struct Part {  ///< a proxy's patches among all
    std::uint32_t first_patch = 0, patches = 0;
    PatchEdges edges;
    BvhRoot scene{};  ///< its box; where its hierarchy starts
  };
  std::vector<Part> parts;
  std::vector<PatchInstance> instances;
  std::vector<Patch> patches;
  BvhRoot top{};
  std::uint32_t pair_numbers = 0;  ///< patches of all instances
  std::size_t map_texels = 0;
  Buffer<WideNode> nodes;
  Buffer<PatchInstance> device_instances;
  Buffer<Patch> device_patches;
  Buffer<PatchParts> device_parts;
  Buffer<float> map;
  Buffer<std::uint32_t> links;

  // Detail: what is wanted, and what is built.
  std::vector<PatchLevel> wanted, built;
  RayDetail ray_detail{0, 0};
  PatchCache cache;
  Buffer<PatchBlock> cache_memory;
  std::vector<PatchSlot> slots;  ///< at: PATCH_NOT_BUILT, too, where another level is built than is wanted
  Buffer<PatchSlot> device_slots;
  std::vector<std::uint32_t> unbuilt_rays;  ///< that came to each patch while it was not built
  bool slots_changed = true;
  bool expects_misses = true;  ///< so many that scouts pay

  // Scratch, for as many rays as the largest batch so far.
  std::size_t scratch_rays = 0;
  Buffer<RayProgress> progress;
  Buffer<std::uint32_t> active, listed;  ///< rays that go on; those that have pairs
  Buffer<std::uint32_t> pair_keys, pair_rays, pair_places, pair_steps, pair_ranges;
  Buffer<std::uint32_t> counts[2];  ///< of a round and of the next: pairs, rays with pairs, rays that begin
  Buffer<Ray> camera_rays;
  Buffer<Hit> pair_hits;
  Buffer<std::uint32_t> nearest;  ///< 64 bits a ray, or nothing

  // What the device is still reading or writing when a cast goes on.
  std::vector<std::uint32_t> keys, places;
  std::vector<PatchBuild> builds, sent_builds;
  std::vector<PatchJob> jobs, sent_jobs;
};

namespace {

using State = PatchTracerState;

std::size_t group_size(const Device& device) { return device.info().is_cpu ? 1 : kGpuGroup; }

std::string group_options(const Device& device) {
  return device.info().is_cpu ? std::string("-DGROUP=1 -DWIDE") : "-DGROUP=" + std::to_string(kGpuGroup);
}

/// Work-items of a kernel whose groups take jobs (kernels/common/work_queue.h).
std::size_t queue_items(const Device& device, std::size_t jobs) {
  if (!device.info().is_cpu) return jobs * kGpuGroup;
  return std::min(std::size_t{device.info().compute_units} * kCpuGroupsPerUnit, jobs);
}

/// The hierarchy goes behind `all`.
void append_nodes(std::vector<WideNode>& all, WideBvh& wide) {
  const auto base = static_cast<std::uint32_t>(all.size());
  const auto relinked = [&](std::uint32_t child) { return child & BVH_LEAF_BIT ? child : child + base; };
  for (WideNode& node : wide.nodes) {
    for (std::uint32_t& child : node.children) child = relinked(child);
    all.push_back(node);
  }
  wide.scene.root = relinked(wide.scene.root);
}

/// Patches whose borders may leave their parts: they or a neighbour can be coarser than 4 x 4.
std::vector<std::uint32_t> loose_patches(const Proxy& proxy, const PatchEdges& edges) {
  const std::vector<PatchLevel> levels = match_borders(edges, uniform_levels(proxy, kLeastLevel));
  std::vector<std::uint32_t> loose;
  for (const PatchLevel& level : levels) {
    const std::uint32_t least = *std::min_element(level.edges.begin(), level.edges.end());
    loose.push_back(std::min(least, level.level) < kLeastLevel ? 1 : 0);
  }
  return loose;
}

void add_proxy(State& state, const Proxy& proxy) {
  State::Part part;
  part.first_patch = static_cast<std::uint32_t>(state.patches.size());
  part.patches = static_cast<std::uint32_t>(proxy.quads.size());
  part.edges = find_edges(proxy);
  const std::vector<std::uint32_t> loose = loose_patches(proxy, part.edges);
  for (std::size_t i = 0; i < proxy.quads.size(); ++i) {
    Patch patch{};
    for (std::size_t k = 0; k < 4; ++k)
      for (int axis = 0; axis < 3; ++axis) patch.corners[k][axis] = proxy.positions[proxy.quads[i][k]][axis];
    const std::size_t texel =
        state.map_texels + std::size_t{proxy.tiles[i].y} * proxy.map_width + proxy.tiles[i].x;
    if (texel > std::numeric_limits<std::uint32_t>::max())
      throw Error(ErrorKind::kBudget, {},
                  "displacement maps of more than 2^32 texels; use fewer or smaller ones");
    patch.texels = static_cast<std::uint32_t>(texel);
    patch.row = proxy.map_width;
    patch.level = tile_level(proxy.tiles[i]);
    patch.loose = loose[i];
    state.patches.push_back(patch);
  }
  state.map_texels += proxy.map.size();
  state.parts.push_back(std::move(part));
}

void upload_slots(State& state) {
  if (!state.slots_changed) return;
  state.device_slots.enqueue_write(state.slots);
  state.slots_changed = false;
}

/// After a change of levels: what is built otherwise is not built.
void match_slots(State& state) {
  std::size_t built = 0, kept = 0;
  for (std::size_t p = 0; p < state.slots.size(); ++p) {
    if (state.slots[p].at == PATCH_NOT_BUILT) continue;
    ++built;
    if (state.built[p] == state.wanted[p])
      ++kept;
    else
      state.slots[p].at = PATCH_NOT_BUILT;
  }
  state.slots_changed = true;
  state.expects_misses = state.expects_misses || kept < built;
}

void set_levels(State& state, std::span<const std::uint32_t> levels) {
  for (const State::Part& part : state.parts) {
    const std::vector<PatchLevel> matched =
        match_borders(part.edges, levels.subspan(part.first_patch, part.patches));
    std::copy(matched.begin(), matched.end(), state.wanted.begin() + part.first_patch);
  }
  match_slots(state);
}

void grow_scratch(const Device& device, State& state, std::size_t rays) {
  if (rays <= state.scratch_rays) return;
  state.scratch_rays = rays;
  const std::size_t batch = std::min(rays, kBatch), pairs = std::max(batch, kLeastPairs);
  state.progress = {device, rays};
  state.active = {device, batch};
  state.listed = {device, batch};
  state.pair_keys = {device, pairs};
  state.pair_rays = {device, pairs};
  state.pair_places = {device, pairs};
  state.pair_steps = {device, pairs};
  state.pair_ranges = {device, 2 * batch};
  state.pair_hits = {device, pairs};
  if (state.config.atomics) {
    state.nearest = {device, 2 * rays};
    state.nearest.fill(0xff);
  }
}

/// One cast of a batch.
class Cast {
 public:
  Cast(const Device& device, State& state, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
       std::size_t first, std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps)
      : device_(device),
        state_(state),
        rays_(rays),
        hits_(hits),
        first_(first),
        count_(count),
        any_(query == RayQuery::kAny ? 1u : 0u),
        steps_(steps != nullptr ? *steps : Buffer<std::uint32_t>()),
        pair_steps_(steps != nullptr ? state.pair_steps : Buffer<std::uint32_t>()) {}

  /// `row`: as trace_rays() has it.
  void run(bool keep_hits, bool scouts, std::uint32_t row) {
    const auto count = static_cast<std::uint32_t>(count_);
    range_ = {static_cast<std::uint32_t>(first_), count, 1, row, keep_hits ? 1u : 0u};
    if (scouts && count_ >= kLeastScouted) {
      RayRange few = range_;
      few.stride = kScouts;
      few.row = 0;
      scout(few, count / kScouts);
    }
    state_.stats.rays += count_;
    std::uint32_t active = count;
    for (int round = 0; active > 0; ++round) active = cast_round(round, active);
  }

 private:
  /// A few of the rays look which patches come first; those are built before the others come, which then need
  /// not be gathered.
  void scout(const RayRange& range, std::uint32_t count) {
    PhaseWatch watch(device_, state_.stats.timed);
    const std::uint32_t pairs = cast_top(0, range, count, 1, false, false).pairs;
    state_.stats.top += watch.lap();
    std::vector<std::uint32_t>& keys = state_.keys;
    read_keys(pairs);
    std::sort(keys.begin(), keys.end());
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    needed_.assign(state_.patches.size(), 0);
    for (const std::uint32_t pair : keys) {
      const PatchInstance& placed = instance_of(pair);
      if (!provide(placed.first_patch + (pair - placed.first_pair))) break;
    }
    state_.stats.sort += watch.lap();
    flush(watch);
  }

  const PatchInstance& instance_of(std::uint32_t pair) const {
    return *(
        std::upper_bound(state_.instances.begin(), state_.instances.end(), pair,
                         [](std::uint32_t p, const PatchInstance& placed) { return p < placed.first_pair; }) -
        1);
  }

  struct Counts {
    std::uint32_t pairs, listed;  ///< rays that have pairs
    std::uint32_t active;         ///< rays that went on
  };

  /// In round 0 the rays of `range` begin, in later ones those go on that the round before has left, at most
  /// `active`.
  Counts cast_top(int round, const RayRange& range, std::uint32_t active, std::uint32_t most, bool at_once,
                  bool packets) {
    upload_slots(state_);
    Buffer<std::uint32_t>& device_counts = state_.counts[round % 2];
    if (round == 0) device_counts.fill(0);
    device_.kernel("trace/trace_patch", packets ? "cast_top_packets" : "cast_top", state_.options)
        .run(packets ? (active + kPacket - 1) / kPacket : active, packets ? kPacketGroup : kRayGroup,
             state_.nodes, state_.top, state_.device_instances, state_.device_patches, state_.device_parts,
             state_.device_slots, state_.cache_memory, state_.links, rays_,
             round == 0 ? Buffer<std::uint32_t>() : state_.active, range, active, any_, at_once ? 1u : 0u,
             most, state_.ray_detail, hits_, state_.progress, state_.pair_keys, state_.pair_rays,
             state_.pair_places, state_.pair_ranges, state_.listed, device_counts, steps_);
    state_.keys.resize(std::min<std::size_t>(kFewPairs, state_.pair_keys.size()));
    state_.pair_keys.enqueue_read(state_.keys);  // most often that is all of them
    std::array<std::uint32_t, 3> counts{};
    device_counts.read(counts);
    has_sent_ = false;
    return {counts[0], counts[1], counts[2]};
  }

  /// After cast_top().
  void read_keys(std::uint32_t pairs) {
    const std::size_t read = state_.keys.size();
    state_.keys.resize(pairs);
    if (pairs > read) state_.pair_keys.read(state_.keys);
  }

  /// Returns how many rays go on, or more than that: few are not worth waiting for their number.
  std::uint32_t cast_round(int round, std::uint32_t active) {
    // Most rays hit the first patch that they meet; those that do not soon want all.
    const auto room = static_cast<std::uint32_t>(std::max<std::size_t>(1, state_.pair_keys.size() / active));
    const std::uint32_t most = std::min({state_.config.pairs, 1u << std::min(2 * round, 8), room});
    PhaseWatch watch(device_, state_.stats.timed);
    const bool at_once = state_.config.at_once,
               packets = state_.config.packets && at_once && device_.info().is_cpu;
    const auto [pairs, listed, went_on] = cast_top(round, range_, active, most, at_once, packets);
    state_.stats.top += watch.lap();
    if (round == 0 || went_on > 0) ++state_.stats.rounds;
    if (pairs == 0) return 0;
    state_.stats.pairs += pairs;

    sort_pairs(pairs);
    state_.stats.sort += watch.lap();

    make_jobs(state_.keys, watch);
    Buffer<std::uint32_t>& next_counts = state_.counts[(round + 1) % 2];
    next_counts.fill(0);
    device_.kernel("trace/trace_patch", "take_hits", state_.options)
        .run(listed, kRayGroup, state_.listed, listed, any_, state_.pair_ranges, state_.pair_hits,
             state_.nearest, state_.progress, hits_, state_.active, next_counts);
    if (pair_steps_.size() > 0)
      device_.kernel("trace/trace_patch", "add_steps", state_.options)
          .run(listed, kRayGroup, state_.listed, listed, state_.pair_ranges, pair_steps_, steps_);
    state_.stats.cast += watch.lap();
    if (listed <= kFewPairs) return listed;
    std::uint32_t going_on = 0;
    next_counts.read(std::span(&going_on, 1), 2);
    has_sent_ = false;
    return going_on;
  }

  /// Afterwards the keys are in ascending order.
  void sort_pairs(std::uint32_t pairs) {
    std::vector<std::uint32_t>&keys = state_.keys, &places = state_.places;
    if (pairs > kFewPairs) {
      unsigned key_bits = 1;
      while (key_bits < 32 && state_.pair_numbers >> key_bits != 0) ++key_bits;
      radix_sort(device_, state_.pair_keys, state_.pair_places, pairs, key_bits);
      read_keys(pairs);
      return;
    }
    read_keys(pairs);
    places.resize(pairs);
    for (std::uint32_t i = 0; i < pairs; ++i) places[i] = i;
    std::sort(places.begin(), places.end(), [&](std::uint32_t a, std::uint32_t b) {
      return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
    });
    std::sort(keys.begin(), keys.end());
    state_.pair_places.enqueue_write(places);
  }

  /// Builds what is missing and casts, as many patches at a time as the cache holds. `keys` are sorted.
  void make_jobs(std::span<const std::uint32_t> keys, PhaseWatch& watch) {
    needed_.assign(state_.patches.size(), 0);
    const auto count = static_cast<std::uint32_t>(keys.size());
    for (std::uint32_t first = 0, end = 0; first < count; first = end) {
      while (end < count && keys[end] == keys[first]) ++end;
      const PatchInstance& placed = instance_of(keys[first]);
      const auto instance = static_cast<std::uint32_t>(&placed - state_.instances.data());
      const std::uint32_t patch = placed.first_patch + (keys[first] - placed.first_pair);
      bool built = !does_without(patch, end - first);
      if (built && !provide(patch)) {
        flush(watch);
        built = provide(patch);
        if (!built && !can_do_without(patch)) {
          device_.finish();  // what is on its way must not go
          throw Error(ErrorKind::kBudget, {},
                      "a patch of " + std::to_string(1u << state_.wanted[patch].level) +
                          " micro-quads a side needs " +
                          std::to_string(std::size_t{blocks_of(patch)} * sizeof(PatchBlock)) +
                          " bytes, more than the patch cache has; make that larger");
        }
      }
      if (!built) state_.stats.unbuilt_rays += end - first;
      const PatchSlot slot =
          built ? state_.slots[patch] : PatchSlot{PATCH_NOT_BUILT, state_.wanted[patch].level};
      for (std::uint32_t begin = first; begin < end; begin += kJobRays)
        state_.jobs.push_back({begin, std::min(begin + kJobRays, end), instance, patch, slot,
                               packed(state_.wanted[patch].edges), 0});
    }
    flush(watch);
  }

  std::uint32_t blocks_of(std::uint32_t patch) const {
    return slot_blocks(state_.wanted[patch].level, device_.info().is_cpu);
  }

  bool can_do_without(std::uint32_t patch) const {
    return state_.wanted[patch].level >= kLeastUnbuiltLevel && state_.patches[patch].loose == 0;
  }

  /// Whether so few rays have come to the patch, so far, that building it does not pay.
  bool does_without(std::uint32_t patch, std::uint32_t rays) {
    if (state_.slots[patch].at != PATCH_NOT_BUILT || !can_do_without(patch) || rays > state_.config.few_rays)
      return false;
    state_.unbuilt_rays[patch] += rays;
    return state_.unbuilt_rays[patch] <= state_.config.few_rays;
  }

  /// False where what is needed already leaves no room.
  bool provide(std::uint32_t patch) {
    PatchSlot& slot = state_.slots[patch];
    if (slot.at == PATCH_NOT_BUILT) {
      const PatchLevel& level = state_.wanted[patch];
      evicted_.clear();
      const std::uint32_t blocks = blocks_of(patch);
      const std::uint32_t at = state_.cache.allocate(
          patch, blocks,
          [&](const PatchCache::Entry& e) { return needed_[e.patch] && state_.slots[e.patch].at == e.at; },
          evicted_);
      for (const PatchCache::Entry& e : evicted_) {
        if (state_.slots[e.patch].at != e.at) continue;
        state_.slots[e.patch].at = PATCH_NOT_BUILT;
        ++state_.stats.evicted;
      }
      state_.slots_changed = true;
      if (at == PatchCache::kNone) return false;
      slot = {at, level.level};
      state_.built[patch] = level;
      state_.unbuilt_rays[patch] = 0;
      state_.builds.push_back({patch, at, level.level, packed(level.edges)});
      ++state_.stats.built;
      state_.stats.built_leaves += std::uint64_t{1} << 2 * level.level;
      state_.stats.built_bytes += std::uint64_t{blocks} * sizeof(PatchBlock);
    }
    needed_[patch] = 1;
    return true;
  }

  void flush(PhaseWatch& watch) {
    std::vector<PatchBuild>& sent_builds = state_.sent_builds;
    std::vector<PatchJob>& sent_jobs = state_.sent_jobs;
    if (has_sent_) device_.finish();
    has_sent_ = true;
    sent_builds.swap(state_.builds);
    sent_jobs.swap(state_.jobs);
    state_.builds.clear();
    state_.jobs.clear();
    if (!sent_builds.empty()) {
      Buffer<PatchBuild> builds(device_, sent_builds.size());
      builds.enqueue_write(sent_builds);
      queue_.fill(0);
      device_.kernel("build/build_patches", "build_patches", group_options(device_))
          .run(queue_items(device_, sent_builds.size()), group_size(device_), state_.device_patches,
               state_.map, builds, static_cast<std::uint32_t>(sent_builds.size()), queue_,
               state_.cache_memory);
      state_.stats.build += watch.lap();
    }
    if (!sent_jobs.empty()) {
      Buffer<PatchJob> jobs(device_, sent_jobs.size());
      jobs.enqueue_write(sent_jobs);
      queue_.fill(0);
      device_.kernel("trace/trace_patch", "cast_patches", state_.options)
          .run(queue_items(device_, sent_jobs.size()), group_size(device_), jobs,
               static_cast<std::uint32_t>(sent_jobs.size()), queue_, state_.device_instances,
               state_.device_patches, state_.device_parts, state_.map, state_.cache_memory, state_.links,
               state_.pair_places, state_.pair_rays, rays_, any_, state_.ray_detail, hits_, state_.pair_hits,
               pair_steps_, state_.nearest);
      state_.stats.jobs += sent_jobs.size();
      state_.stats.cast += watch.lap();
    }
    std::fill(needed_.begin(), needed_.end(), 0);
  }

  const Device& device_;
  State& state_;
  const Buffer<Ray>& rays_;
  const Buffer<Hit>& hits_;
  std::size_t first_, count_;
  std::uint32_t any_;
  RayRange range_{};
  Buffer<std::uint32_t> steps_, pair_steps_;
  Buffer<std::uint32_t> queue_{device_, 1};
  std::vector<std::uint8_t> needed_;  ///< patches of the jobs that wait
  bool has_sent_ = false;             ///< what is not known to have arrived
  std::vector<PatchCache::Entry> evicted_;
};

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
  const Device& device = tracer.device;
  RBVH_CHECK(rays.size() >= count && hits.size() >= count && (steps == nullptr || steps->size() >= count));
  if (count == 0) return;
  if (state.instances.empty()) {
    if (!keep_hits) miss_all(hits, count, steps);
    return;
  }
  if (!state.config.keep) clear_cache(tracer);
  grow_scratch(device, state, count);
  const bool scouts = state.config.at_once && state.expects_misses;
  const std::uint64_t pairs_before = state.stats.pairs;
  if (row >= kBatch / kSquare) row = 0;
  const std::size_t rows = std::size_t{kSquare} * row, batch = row > 0 ? kBatch / rows * rows : kBatch;
  for (std::size_t first = 0; first < count; first += batch)
    Cast(device, state, rays, hits, first, std::min(batch, count - first), query, steps)
        .run(keep_hits, scouts, row);
  state.expects_misses = (state.stats.pairs - pairs_before) * kScouts > count;
}

}  // namespace

PatchTracer make_patch_tracer(const Device& device, std::span<const Proxy* const> proxies,
                              std::span<const ProxyInstance> instances, const ProxyConfig& config) {
  PatchTracer tracer{device, std::make_shared<PatchTracerState>()};
  State& state = *tracer.state;
  state.config = config;
  state.config.pairs = std::clamp(config.pairs, 1u, kMostPairs);
  state.config.atomics = config.atomics && device.info().has_int64_atomics;

  for (const Proxy* proxy : proxies) add_proxy(state, *proxy);
  state.map = {device, 3 * state.map_texels + 16};  // kernels read a little more than the last one
  std::size_t at = 0;
  for (const Proxy* proxy : proxies) {
    state.map.write({&proxy->map.data()->x, 3 * proxy->map.size()}, at);
    at += 3 * proxy->map.size();
  }
  const std::size_t count = state.patches.size();
  state.device_patches = {device, state.patches};
  state.device_parts = {device, count};
  if (count > 0) {
    device.kernel("build/build_patches", "bound_patches", group_options(device))
        .run(count, group_size(device), state.device_patches, static_cast<std::uint32_t>(count), state.map,
             state.device_parts);
    state.device_patches.read(state.patches);
  }

  // Middle hierarchies over each proxy's patches, then the top one over the instances; the top one's nodes
  // come first.
  std::vector<WideNode> middle_nodes, top_nodes;
  std::uint32_t stack = 1;
  for (State::Part& part : state.parts) {
    std::vector<Bounds3f> boxes(part.patches);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      const Patch& p = state.patches[part.first_patch + i];
      boxes[i] = {{p.lo[0], p.lo[1], p.lo[2]}, {p.hi[0], p.hi[1], p.hi[2]}};
    }
    WideBvh wide = build_wide_bvh(boxes);
    append_nodes(middle_nodes, wide);
    part.scene = wide.scene;
    stack = std::max(stack, wide.stack);
  }
  std::vector<Bounds3f> boxes;
  for (const ProxyInstance& instance : instances) {
    const State::Part& part = state.parts.at(instance.proxy);
    if (part.patches == 0) continue;
    PatchInstance placed{};
    const Affine to_object = inverse(instance.to_world);
    for (std::size_t i = 0; i < 12; ++i) placed.to_object[i] = static_cast<float>(to_object.m[i]);
    std::copy_n(part.scene.lo, 3, placed.lo);
    std::copy_n(part.scene.hi, 3, placed.hi);
    placed.root = part.scene.root;
    placed.first_pair = state.pair_numbers;
    placed.first_patch = part.first_patch;
    placed.first_leaf = instance.first_leaf;
    if (std::uint64_t{state.pair_numbers} + part.patches >= PATCH_NOT_BUILT)
      throw Error(ErrorKind::kBudget, {}, "more than 2^32 patches in all instances; leave some out");
    state.pair_numbers += part.patches;
    state.instances.push_back(placed);
    const Bounds3d box = {{placed.lo[0], placed.lo[1], placed.lo[2]},
                          {placed.hi[0], placed.hi[1], placed.hi[2]}};
    const Bounds3d image = transformed(instance.to_world, box);
    const double pad = 1e-6 * std::max(length(image.lo), length(image.hi));
    Bounds3f padded;
    padded.add(static_cast<Vec3f>(image.lo - Vec3d{pad, pad, pad}));
    padded.add(static_cast<Vec3f>(image.hi + Vec3d{pad, pad, pad}));
    boxes.push_back(padded);
  }
  WideBvh wide = build_wide_bvh(boxes);
  append_nodes(top_nodes, wide);
  state.top = wide.scene;
  stack = std::max(stack, wide.stack);
  const auto base = static_cast<std::uint32_t>(top_nodes.size());
  for (WideNode& node : middle_nodes) {
    for (std::uint32_t& child : node.children)
      if (!(child & BVH_LEAF_BIT)) child += base;
    top_nodes.push_back(node);
  }
  for (PatchInstance& placed : state.instances)
    if (!(placed.root & BVH_LEAF_BIT)) placed.root += base;
  state.nodes = {device, top_nodes};
  state.device_instances = {device, state.instances};

  state.links = {device, make_links()};
  state.wanted.resize(count);
  state.built.resize(count);
  state.unbuilt_rays.assign(count, 0);
  state.slots.assign(count, {PATCH_NOT_BUILT, 0});
  state.device_slots = {device, count};
  state.cache = PatchCache(static_cast<std::uint32_t>(
      std::min<std::size_t>(config.cache_bytes / sizeof(PatchBlock), 0xfffffff0u)));
  state.cache_memory = {device, state.cache.capacity()};
  for (Buffer<std::uint32_t>& counts : state.counts) counts = {device, 3};
  state.options = group_options(device) + " -DSTACK=" + std::to_string((stack + 63) / 64 * 64) +
                  " -DMOST=" + std::to_string(kMostPairs) + (state.config.atomics ? " -DATOMICS" : "");
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
  const Vec3d right = {camera.right[0], camera.right[1], camera.right[2]};
  const double spread = pixels * length(right);
  const Vec3d eye = {camera.position[0], camera.position[1], camera.position[2]};
  std::vector<std::uint32_t> levels(state.patches.size(), 0);
  for (const PatchInstance& instance : state.instances) {
    Affine to_object;
    for (std::size_t i = 0; i < 12; ++i) to_object.m[i] = static_cast<double>(instance.to_object[i]);
    const Vec3d at = to_object.point(eye);
    const std::size_t end = &instance + 1 == state.instances.data() + state.instances.size()
                                ? state.pair_numbers
                                : (&instance + 1)->first_pair;
    for (std::size_t i = 0; i < end - instance.first_pair; ++i) {
      const Patch& p = state.patches[instance.first_patch + i];
      double square = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double lo = p.lo[axis], hi = p.hi[axis];
        const double gap = std::max({lo - at[axis], at[axis] - hi, 0.0});
        square += gap * gap;
      }
      const double pieces =
          static_cast<double>(p.size) / (spread * std::sqrt(square)) * std::numbers::sqrt2 / 2;
      std::uint32_t level = std::min(kLeastLevel, p.level);
      while (level < p.level && !(static_cast<double>(1u << level) >= pieces)) ++level;
      std::uint32_t& wanted = levels[instance.first_patch + i];
      wanted = std::max(wanted, level);
    }
  }
  set_levels(state, levels);
  state.ray_detail = {0, static_cast<float>(spread)};
}

void set_detail(const PatchTracer& tracer, std::uint32_t most) {
  State& state = *tracer.state;
  std::vector<std::uint32_t> levels;
  for (const Patch& patch : state.patches)
    levels.push_back(std::min(patch.level, std::max(most, kLeastLevel)));
  set_levels(state, levels);
  state.ray_detail = {0, 0};
}

void resolve_everything(const PatchTracer& tracer) { tracer.state->ray_detail = {0, 0}; }

std::vector<PatchLevel> levels_in_use(const PatchTracer& tracer, std::uint32_t proxy) {
  const State& state = *tracer.state;
  const State::Part& part = state.parts.at(proxy);
  const auto first = state.wanted.begin() + part.first_patch;
  return {first, first + part.patches};
}

void trace_rays(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps, std::uint32_t row) {
  trace(tracer, rays, hits, count, query, steps, false, row);
}

void trace_rays_further(const PatchTracer& tracer, const Buffer<Ray>& rays, const Buffer<Hit>& hits,
                        std::size_t count, RayQuery query, const Buffer<std::uint32_t>* steps,
                        std::uint32_t row) {
  trace(tracer, rays, hits, count, query, steps, true, row);
}

void trace_camera(const PatchTracer& tracer, const CameraRays& camera, const Buffer<Hit>& hits,
                  const Buffer<std::uint32_t>* steps) {
  set_detail(tracer, camera);
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  Buffer<Ray>& rays = tracer.state->camera_rays;
  if (rays.size() < pixels) rays = {tracer.device, pixels};
  const std::size_t squares = std::size_t{(camera.width + 7) / 8} * ((camera.height + 7) / 8);
  tracer.device.kernel("trace/trace_scene", "write_camera_rays").run(squares * 64, kRayGroup, camera, rays);
  trace_rays(tracer, rays, hits, pixels, RayQuery::kNearest, steps, camera.width);
}

ProxyStats& stats(const PatchTracer& tracer) { return tracer.state->stats; }

ProxyBytes bytes(const PatchTracer& tracer) {
  const State& state = *tracer.state;
  ProxyBytes b;
  b.base = state.nodes.size() * sizeof(WideNode) + state.instances.size() * sizeof(PatchInstance) +
           state.patches.size() * (sizeof(Patch) + sizeof(PatchParts) + sizeof(PatchSlot)) +
           state.links.size() * sizeof(std::uint32_t);
  b.maps = state.map_texels * 3 * sizeof(float);
  b.cache = state.cache_memory.size() * sizeof(PatchBlock);
  b.cached = state.cache.used() * sizeof(PatchBlock);
  return b;
}

void clear_cache(const PatchTracer& tracer) {
  State& state = *tracer.state;
  state.cache.clear();
  for (PatchSlot& slot : state.slots) slot.at = PATCH_NOT_BUILT;
  std::fill(state.unbuilt_rays.begin(), state.unbuilt_rays.end(), 0);
  state.slots_changed = state.expects_misses = true;
}

}  // namespace rbvh
