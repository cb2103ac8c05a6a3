#include "pipeline/rbvh/build.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <future>
#include <span>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/rbvh/assemble_level.h"
#include "pipeline/rbvh/build_tuning.h"
#include "pipeline/rbvh/group_primitives.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_rule.h"
#include "pipeline/rbvh/reached_error.h"
#include "pipeline/rbvh/refine.h"
#include "pipeline/rbvh/snap_primitives.h"
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

Level build_of_primitives(const Scan& scan, const LevelRule& rule, const Lattice& lattice,
                          BuildTimings& time) {
  Stopwatch watch;
  RefinedLevel groups = group_primitives(scan, lattice);
  time.partition += watch.lap();
  Level level = assemble_level(rule.level, groups, scan, rule.area, lattice);
  time.pack += watch.lap();
  return level;
}

/// A level of primitives in the making.
struct PrimitiveLevel {
  std::size_t number = 0;
  Scan simplified;
  BuildTimings time;
};

/// The levels of primitives, each simplified from the one before; a level is finished while the next is
/// simplified.
void build_levels_of_primitives(const Scan& scan, std::span<const LevelRule> rules, const Bounds3f& box,
                                std::vector<Level>& levels, BuildTimings& time) {
  std::deque<PrimitiveLevel> making;         // their addresses stay
  std::vector<std::future<Level>> finished;  // after what they read: they are waited for first
  const Scan* finer = &scan;
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const LevelRule& rule = rules[i];
    if (!rule.holds_primitives) continue;
    PrimitiveLevel& own = making.emplace_back();
    own.number = i;
    if (rule.error > 0 && !scan.is_cloud()) {
      Stopwatch watch;
      own.simplified = simplify(*finer, rule.error);
      widen_thin_parts(own.simplified, lattice_of(rule.error, box));
      own.time.simplify = watch.lap();
      finer = &own.simplified;
    }
    finished.push_back(std::async(std::launch::async, [&own, &rule, &box, finer] {
      return build_of_primitives(*finer, rule, lattice_of(rule.error, box), own.time);
    }));
  }
  for (std::size_t i = 0; i < making.size(); ++i) {
    const PrimitiveLevel& own = making[i];
    levels[own.number] = finished[i].get();
    time.simplify += own.time.simplify;
    time.partition += own.time.partition;
    time.pack += own.time.pack;
    time.levels[own.number] = {levels[own.number].name,
                               own.time.simplify + own.time.partition + own.time.pack};
  }
}

/// Nothing in its construction keeps a level's error for sure: quadrics let a thin plate shrink in its plane.
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
  BuildTimings host_time;
  host_time.levels.resize(rules.size());
  std::future<void> of_primitives = std::async(
      std::launch::async, [&] { build_levels_of_primitives(scan, rules, box, rbvh.levels, host_time); });
  for (std::size_t i = 0; i < rules.size(); ++i) {
    if (rules[i].holds_primitives) continue;
    report(progress, "tiles", static_cast<double>(i) / static_cast<double>(rules.size()));
    Stopwatch level_watch;
    RefinedLevel refined = refine_level(primitives, partition, rules[i], watch, time);
    rbvh.levels[i] = assemble_level(rules[i].level, refined, scan, area, lattice_of(rules[i].error, box));
    sample_error(device, scan, box, rbvh.levels[i]);
    time.pack += watch.lap();
    time.levels[i] = {rules[i].level.name, level_watch.lap()};
  }
  of_primitives.get();
  time.simplify += host_time.simplify;
  time.partition += host_time.partition;
  time.pack += host_time.pack;
  for (std::size_t i = 0; i < rules.size(); ++i)
    if (rules[i].holds_primitives) time.levels[i] = host_time.levels[i];
  for (std::size_t i = 0; i < rules.size(); ++i)
    if (rules[i].holds_primitives) sample_error(device, scan, box, rbvh.levels[i]);
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
