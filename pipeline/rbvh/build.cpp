#include "pipeline/rbvh/build.h"

#include <algorithm>
#include <cmath>
#include <future>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/rbvh/build_tuning.h"
#include "pipeline/rbvh/group_primitives.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_rule.h"
#include "pipeline/rbvh/pack.h"
#include "pipeline/rbvh/reached_error.h"
#include "pipeline/rbvh/refine.h"
#include "pipeline/scan/simplify.h"

namespace rbvh {
namespace {

/// In scan units squared: squares of areas must stay within float on the device.
constexpr float kLeastArea = 1e-15f, kMostArea = 1e17f;

/// At a build's peak: the scan and its primitives, and the tiles' texels.
constexpr std::uint64_t kBytesPerVertex = 80, kBytesPerPrimitive = 160, kBytesPerTexel = 40;

float checked_area(const BuildConfig& config, float own_area) {
  const float area = config.area > 0 && own_area > 0 ? static_cast<float>(config.area) : own_area;
  if (!(area > 0)) throw Error(ErrorKind::kInput, "", "the scan has no area");
  if (!(area >= kLeastArea && area <= kMostArea))
    throw Error(
        ErrorKind::kInput, "",
        "the scan's area is beyond what float can work with; scale it to a size between 1e-6 and 1e8");
  return area;
}

/// The lattice's step to the level's error: rounding adds little to it.
constexpr float kLatticeStep = 0.25f;
/// A float keeps whole numbers up to 2^24: finer lattices do not hold what they promise.
constexpr float kFinestStep = 1.0f / (1 << 22);

/// What is rounded, is rounded to the finest error anywhere in the level: that at the focus.
float finest_error(const LevelConfig& level, const BuildConfig& config) {
  return config.focus ? std::min(level.error, config.focus->level.error) : level.error;
}

/// `error`: scan units.
Lattice lattice_of(float error, const Bounds3f& box) {
  const float step = kLatticeStep * error;
  float largest = 0;
  for (int axis = 0; axis < 3; ++axis)
    largest = std::max({largest, std::abs(box.lo[axis]), std::abs(box.hi[axis])});
  if (!(step > kFinestStep * largest)) return {};
  return {box.lo, step};
}

LevelRule make_rule(const LevelConfig& level, const BuildConfig& config, float area, float diagonal,
                    const Primitives& primitives, const BuildTuning& tuning) {
  const LevelFacts facts{.is_cloud = primitives.discs,
                         .error = config.focus ? 0 : level.error,  // the density varies with the place
                         .rho = level.rho,
                         .texel = primitive_texel(static_cast<double>(area), level.rho) / diagonal,
                         .primitives = primitives.count};
  return {.level = level,
          .config = &config,
          .area = area,
          .largest_tile = tuning.largest_tile,
          .error = finest_error(level, config) * diagonal,
          .holds_primitives = holds_primitives(config.hybrid, facts)};
}

/// The scan as far as it is simplified: each coarser level goes on from the one before.
struct SimplifiedScan {
  const Scan* scan;
  Scan own = {};
};

Level build_of_primitives(SimplifiedScan& simplified, const LevelRule& rule, const Lattice& lattice,
                          Stopwatch& watch, BuildTimings& time) {
  if (rule.error > 0 && !simplified.scan->is_cloud()) {
    simplified.own = simplify(*simplified.scan, rule.error);
    simplified.scan = &simplified.own;
    time.simplify += watch.lap();
  }
  RefinedLevel groups = group_primitives(*simplified.scan, lattice);
  time.partition += watch.lap();
  Level level = pack_level(rule.level, groups, *simplified.scan, rule.area, lattice);
  time.pack += watch.lap();
  return level;
}

/// Where nothing in its construction keeps the level's error.
void sample_error(const Device& device, const Scan& scan, const Bounds3f& box, Level& level) {
  if (level.error > 0)
    level.reached =
        static_cast<float>(sampled_error(device, level, scan) / static_cast<double>(box.diagonal()));
}

}  // namespace

void check_buildable(const Scan& scan, const std::string& file) {
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    if (!is_finite(scan.positions[i]))
      throw Error(ErrorKind::kInput, file, "vertex " + std::to_string(i) + " is not finite; ingest it first");
  if (scan.is_cloud() && (scan.normals.empty() || scan.radii.empty()))
    throw Error(ErrorKind::kInput, file, "the points have no normals or radii; ingest it first");
}

std::uint64_t build_memory(const Scan& scan, const BuildConfig& config) {
  const std::uint64_t primitives = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  return scan.positions.size() * kBytesPerVertex + primitives * kBytesPerPrimitive +
         static_cast<std::uint64_t>(config.levels.front().rho) * kBytesPerTexel;
}

Rbvh build_rbvh(const Device& device, const Scan& scan, const BuildConfig& config, const Progress& progress,
                BuildTimings* timings) {
  return build_tuned(device, scan, config, {}, progress, timings);
}

Rbvh build_tuned(const Device& device, const Scan& scan, const BuildConfig& config, const BuildTuning& tuning,
                 const Progress& progress, BuildTimings* timings) {
  BuildTimings unasked;
  BuildTimings& time = timings != nullptr ? *timings : unasked;
  time = {};
  Stopwatch watch;
  report(progress, "upload", 0);
  const Primitives primitives = upload_primitives(device, scan);
  const bool cones = config.refinement == Refinement::kConeOfNormals;
  Partition partition = make_root(primitives, cones, config.split, config.partition);
  const float area = checked_area(config, partition.nodes[0].sums.area);
  const Bounds3f box = bounds(scan);
  time.upload += watch.lap();

  std::vector<LevelRule> rules;
  for (LevelConfig level : config.levels) {
    if (primitives.discs) level.rho = cloud_rho(level.rho, primitives.count);
    rules.push_back(make_rule(level, config, area, box.diagonal(), primitives, tuning));
  }
  // One tree serves all levels of tiles.
  const auto any_level_splits = [&](const PartitionNode& node) {
    return std::any_of(rules.begin(), rules.end(), [&](const LevelRule& rule) {
      return !rule.holds_primitives && wants_split(rule, node);
    });
  };
  if (any_level_splits(partition.nodes[0]))
    split_nodes(partition, primitives, {0}, any_level_splits, progress);
  time.partition += watch.lap();

  // The device makes the levels of tiles while the host makes those of primitives.
  Rbvh rbvh;
  rbvh.levels.resize(rules.size());
  time.levels.resize(rules.size());
  BuildTimings chain_time;
  std::future<void> chain = std::async(std::launch::async, [&] {
    Stopwatch chain_watch;
    SimplifiedScan simplified{.scan = &scan};
    for (std::size_t i = 0; i < rules.size(); ++i) {
      if (!rules[i].holds_primitives) continue;
      Stopwatch level_watch;
      rbvh.levels[i] =
          build_of_primitives(simplified, rules[i], lattice_of(rules[i].error, box), chain_watch, chain_time);
      time.levels[i] = {rules[i].level.name, level_watch.lap()};
    }
  });
  for (std::size_t i = 0; i < rules.size(); ++i) {
    if (rules[i].holds_primitives) continue;
    report(progress, "tiles", static_cast<double>(i) / static_cast<double>(rules.size()));
    Stopwatch level_watch;
    RefinedLevel refined = refine_level(primitives, partition, rules[i], watch, time);
    rbvh.levels[i] = pack_level(rules[i].level, refined, scan, area, lattice_of(rules[i].error, box));
    sample_error(device, scan, box, rbvh.levels[i]);
    time.pack += watch.lap();
    time.levels[i] = {rules[i].level.name, level_watch.lap()};
  }
  chain.get();
  if (scan.is_cloud())
    for (std::size_t i = 0; i < rules.size(); ++i)
      if (rules[i].holds_primitives) sample_error(device, scan, box, rbvh.levels[i]);
  time.simplify += chain_time.simplify;
  time.partition += chain_time.partition;
  time.pack += chain_time.pack;
  report(progress, "tiles", 1);
  rbvh.source.vertices = scan.positions.size();
  rbvh.source.triangles = scan.triangles.size();
  rbvh.source.area = area;
  rbvh.source.shift = scan.shift;
  if (!scan.units.empty()) rbvh.source.units = scan.units;
  rbvh.source.bounds = bounds(scan);
  return rbvh;
}

}  // namespace rbvh
