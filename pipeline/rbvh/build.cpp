#include "pipeline/rbvh/build_part.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <future>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/rbvh/assemble_level.h"
#include "pipeline/rbvh/build_tuning.h"
#include "pipeline/rbvh/group_primitives.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/level_rule.h"
#include "pipeline/rbvh/reached_error.h"
#include "pipeline/rbvh/refine.h"
#include "pipeline/rbvh/snap_primitives.h"
#include "pipeline/rbvh/texture_layer.h"
#include "pipeline/scan/radii.h"
#include "pipeline/scan/simplify.h"

namespace rbvh {
namespace {

/// In scan units squared: squares of areas must stay within float on the device.
constexpr float kLeastArea = 1e-15f, kMostArea = 1e17f;

/// At a build's peak: the scan and its primitives, and the tiles' texels.
constexpr std::uint64_t kBytesPerVertex = 80, kBytesPerPrimitive = 160, kBytesPerTexel = 40;

float checked_area(const BuildConfig& config, double own_area) {
  const auto area = static_cast<float>(config.area > 0 && own_area > 0 ? config.area : own_area);
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

/// `joined`: where it is part of a level that is there already.
LevelRule make_rule(LevelConfig level, const BuildConfig& config, const ScanPart& part, float area,
                    const BuildTuning& tuning, const JoinedLevel* joined) {
  const bool is_cloud = part.triangles == 0;
  const float diagonal = part.box.diagonal();
  const auto primitives = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(is_cloud ? part.vertices : part.triangles, 0xffffffffu));
  if (is_cloud && joined == nullptr) level.rho = cloud_rho(level.rho, primitives);
  const LevelFacts facts{.is_cloud = is_cloud,
                         .error = config.focus ? 0 : level.error,  // the density varies with the place
                         .rho = level.rho,
                         .texel = primitive_texel(static_cast<double>(area), level.rho) / diagonal,
                         .primitives = primitives};
  LevelRule rule{.level = level,
                 .config = &config,
                 .area = area,
                 .largest_tile = tuning.largest_tile,
                 .one_sided = tuning.one_sided || part.one_sided,
                 .error = finest_error(level, config) * diagonal,
                 .holds_primitives = holds_primitives(config.hybrid, facts),
                 .lattice = {},
                 .grid = {}};
  rule.lattice = lattice_of(rule.error, part.box);
  if (joined == nullptr) return rule;
  rule.holds_primitives = joined->holds_primitives;
  rule.lattice = joined->lattice;
  rule.grid = joined->grid;
  return rule;
}

std::vector<LevelRule> make_rules(const BuildConfig& config, const ScanPart& part, float area,
                                  const BuildTuning& tuning) {
  std::vector<LevelRule> rules;
  for (std::size_t i = 0; i < config.levels.size(); ++i)
    rules.push_back(make_rule(config.levels[i], config, part, area, tuning,
                              part.joined.empty() ? nullptr : &part.joined[i]));
  return rules;
}

bool all_hold_primitives(std::span<const LevelRule> rules) {
  return std::all_of(rules.begin(), rules.end(), [](const LevelRule& rule) { return rule.holds_primitives; });
}

/// Nothing in its construction keeps a level's error for sure: quadrics let a thin plate shrink in its plane.
void sample_error(const Device& device, const Scan& scan, const Bounds3f& box, Level& level) {
  if (level.error > 0)
    level.reached =
        static_cast<float>(sampled_error(device, level, scan) / static_cast<double>(box.diagonal()));
}

LeafGrid grid_of(const LevelRule& rule, const Scan& scan) {
  return rule.grid ? *rule.grid : leaf_grid(bounds(scan));
}

/// `simplified`: whose primitives it holds.
Level build_of_primitives(const Device& device, const Scan& scan, const Scan& simplified,
                          const LevelRule& rule, const Bounds3f& box, BuildTimings& time) {
  Stopwatch watch;
  RefinedLevel groups = group_primitives(simplified, rule.lattice, rule.one_sided);
  time.partition += watch.lap();
  Level level =
      assemble_level(rule.level, groups, simplified, rule.area, rule.lattice, grid_of(rule, simplified));
  sample_error(device, scan, box, level);
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
void build_levels_of_primitives(const Device& device, const Scan& scan, std::span<const LevelRule> rules,
                                const ScanPart& part, std::vector<Level>& levels, BuildTimings& time) {
  const Bounds3f& box = part.box;
  std::vector<std::uint8_t> stays = part.stays;  // of the finer level's vertices
  std::deque<PrimitiveLevel> making;             // their addresses stay
  std::vector<std::future<Level>> finished;      // after what they read: they are waited for first
  const Scan* finer = &scan;
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const LevelRule& rule = rules[i];
    if (!rule.holds_primitives) continue;
    PrimitiveLevel& own = making.emplace_back();
    own.number = i;
    if (rule.error > 0 && !scan.is_cloud()) {
      Stopwatch watch;
      own.simplified = simplify(*finer, rule.error, &stays);
      widen_thin_parts(own.simplified, rule.lattice, stays);
      own.time.simplify = watch.lap();
      finer = &own.simplified;
    }
    finished.push_back(std::async(std::launch::async, [&, finer, own = &own, rule = &rule] {
      return build_of_primitives(device, scan, *finer, *rule, box, own->time);
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

/// What levels of tiles are made of.
struct TileSource {
  Primitives primitives;
  Partition partition;
};

TileSource upload(const Device& device, const Scan& scan, const BuildConfig& config) {
  Primitives primitives = upload_primitives(device, scan);
  Partition root =
      make_root(primitives, config.refinement == Refinement::kConeOfNormals, config.split, config.partition);
  return {std::move(primitives), std::move(root)};
}

/// What is known before any level is made.
struct BuildPlan {
  std::vector<LevelRule> rules;
  std::optional<TileSource> tiles;  ///< where a level has any
};

BuildPlan plan_levels(const Device& device, const Scan& scan, const ScanPart& part, const BuildConfig& config,
                      const BuildTuning& tuning) {
  BuildPlan plan;
  if (!scan.is_cloud())
    plan.rules = make_rules(config, part, checked_area(config, surface_area(scan)), tuning);
  if (!scan.is_cloud() && all_hold_primitives(plan.rules)) return plan;
  plan.tiles = upload(device, scan, config);
  // Without the area of noise.
  const float area = checked_area(config, static_cast<double>(plan.tiles->partition.nodes[0].sums.area));
  plan.rules = make_rules(config, part, area, tuning);
  return plan;
}

void build_levels_of_tiles(TileSource& source, const Scan& scan, std::span<const LevelRule> rules,
                           const ScanPart& part, const Progress& progress, std::vector<Level>& levels,
                           BuildTimings& time) {
  Stopwatch watch;
  const Primitives& primitives = source.primitives;
  // One tree serves all levels.
  const auto any_level_splits = [&](const PartitionNode& node) {
    return std::any_of(rules.begin(), rules.end(), [&](const LevelRule& rule) {
      return !rule.holds_primitives && wants_split(rule, node);
    });
  };
  if (any_level_splits(source.partition.nodes[0]))
    split_nodes(source.partition, primitives, {0}, any_level_splits, progress);
  time.partition += watch.lap();
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const LevelRule& rule = rules[i];
    if (rule.holds_primitives) continue;
    report(progress, "tiles", static_cast<double>(i) / static_cast<double>(rules.size()));
    Stopwatch level_watch;
    RefinedLevel refined = refine_level(primitives, source.partition, rule, part.own_primitives, watch, time);
    levels[i] = assemble_level(rule.level, refined, scan, rule.area, rule.lattice, grid_of(rule, scan));
    sample_error(primitives.device, scan, part.box, levels[i]);
    time.pack += watch.lap();
    time.levels[i] = {rule.level.name, level_watch.lap()};
  }
}

/// Makes levels of tiles that miss their errors anew, of primitives, where these are nearer to the scan.
void replace_missed_tiles(const Device& device, const Scan& scan, std::vector<LevelRule> rules,
                          const ScanPart& part, std::vector<Level>& levels, BuildTimings& time) {
  for (std::size_t i = 0; i < rules.size(); ++i) {
    LevelRule& rule = rules[i];
    const LevelFacts facts{.is_cloud = scan.is_cloud(), .error = rule.config->focus ? 0 : rule.level.error};
    rule.holds_primitives =
        !rule.holds_primitives && gives_up_tiles(rule.config->hybrid, facts, levels[i].reached);
  }
  if (std::none_of(rules.begin(), rules.end(), [](const LevelRule& rule) { return rule.holds_primitives; }))
    return;
  std::vector<Level> anew(rules.size());
  const std::vector<BuildTimings::PerLevel> before = time.levels;
  build_levels_of_primitives(device, scan, rules, part, anew, time);
  for (std::size_t i = 0; i < rules.size(); ++i) {
    if (!rules[i].holds_primitives) continue;
    time.levels[i].seconds += before[i].seconds;
    if (anew[i].reached < levels[i].reached) levels[i] = std::move(anew[i]);
  }
}

/// `scan`: the part's own.
Rbvh build_levels(const Device& device, const Scan& scan, const ScanPart& part, BuildPlan& plan,
                  const Progress& progress, BuildTimings& time) {
  const std::vector<LevelRule>& rules = plan.rules;
  // The device makes the levels of tiles while the host makes those of primitives.
  Rbvh rbvh;
  rbvh.levels.resize(rules.size());
  time.levels.resize(rules.size());
  BuildTimings host_time;
  host_time.levels.resize(rules.size());
  std::future<void> of_primitives = std::async(std::launch::async, [&] {
    build_levels_of_primitives(device, scan, rules, part, rbvh.levels, host_time);
  });
  if (plan.tiles) build_levels_of_tiles(*plan.tiles, scan, rules, part, progress, rbvh.levels, time);
  of_primitives.get();
  time.simplify += host_time.simplify;
  time.partition += host_time.partition;
  time.pack += host_time.pack;
  for (std::size_t i = 0; i < rules.size(); ++i)
    if (rules[i].holds_primitives) time.levels[i] = host_time.levels[i];
  plan.tiles.reset();
  replace_missed_tiles(device, scan, rules, part, rbvh.levels, time);
  report(progress, "tiles", 1);
  rbvh.source.vertices = part.vertices;
  rbvh.source.triangles = part.triangles;
  rbvh.source.area = rules.front().area;
  rbvh.source.shift = scan.shift;
  if (!scan.units.empty()) rbvh.source.units = scan.units;
  rbvh.source.bounds = part.box;
  return rbvh;
}

/// The neighbours' primitives become an object of their own: no tile holds theirs and others.
void set_apart(Scan& scan, std::uint32_t own_primitives) {
  const std::size_t all = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  if (own_primitives == all) return;
  scan.object_ids.resize(all, 0);
  const auto begin = scan.object_ids.begin(), end = begin + static_cast<std::ptrdiff_t>(own_primitives);
  const auto [least, most] = std::minmax_element(begin, end);
  const bool is_room = *most < std::numeric_limits<std::int32_t>::max();
  std::fill(end, scan.object_ids.end(), is_room ? *most + 1 : *least - 1);
}

void keep_own(Scan& scan, const ScanPart& part, bool has_objects) {
  scan.positions.resize(part.own_vertices);
  if (!scan.normals.empty()) scan.normals.resize(part.own_vertices);
  if (!scan.radii.empty()) scan.radii.resize(part.own_vertices);
  if (!scan.colors.empty()) scan.colors.resize(part.own_vertices);
  for (ScalarProperty& property : scan.properties) property.values.resize(part.own_vertices);
  if (!scan.triangles.empty()) scan.triangles.resize(part.own_primitives);
  scan.object_ids.resize(has_objects ? part.own_primitives : 0);
}

}  // namespace

void check_buildable(const Scan& scan, const std::string& file) {
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    if (!is_finite(scan.positions[i]))
      throw Error(ErrorKind::kInput, file, "vertex " + std::to_string(i) + " is not finite; ingest it first");
  if (scan.is_cloud() && (scan.normals.empty() || scan.radii.empty()))
    throw Error(ErrorKind::kInput, file, "the points have no normals or radii; ingest it first");
}

std::uint64_t build_memory(std::uint64_t vertices, std::uint64_t primitives, const BuildConfig& config) {
  return vertices * kBytesPerVertex + primitives * kBytesPerPrimitive +
         static_cast<std::uint64_t>(config.levels.front().rho) * kBytesPerTexel;
}

std::uint64_t build_memory(const Scan& scan, const BuildConfig& config) {
  const std::uint64_t bytes = build_memory(
      scan.positions.size(), scan.is_cloud() ? scan.positions.size() : scan.triangles.size(), config);
  if (scan.textures.empty()) return bytes;
  return bytes + texture_layer_memory(scan, config.levels, config.color_scale);
}

Rbvh build_rbvh(const Device& device, const Scan& scan, const BuildConfig& config, const Progress& progress,
                BuildTimings* timings) {
  if (scan.textures.empty()) return build_tuned(device, scan, config, {}, progress, timings);
  Rbvh rbvh = build_tuned(device, colored_by_textures(scan), config, {.one_sided = true}, progress, timings);
  add_texture_layers(rbvh.levels, scan, config.color_scale, progress);
  return rbvh;
}

Rbvh build_tuned(const Device& device, const Scan& scan, const BuildConfig& config, const BuildTuning& tuning,
                 const Progress& progress, BuildTimings* timings) {
  BuildTimings unasked;
  BuildTimings& time = timings != nullptr ? *timings : unasked;
  time = {};
  Stopwatch watch;
  report(progress, "upload", 0);
  const ScanPart all{.box = bounds(scan),
                     .vertices = scan.positions.size(),
                     .triangles = scan.triangles.size(),
                     .own_vertices = static_cast<std::uint32_t>(scan.positions.size()),
                     .own_primitives = static_cast<std::uint32_t>(scan.is_cloud() ? scan.positions.size()
                                                                                  : scan.triangles.size()),
                     .stays = {}};
  BuildPlan plan = plan_levels(device, scan, all, config, tuning);
  time.upload += watch.lap();
  return build_levels(device, scan, all, plan, progress, time);
}

float widest_texel(const ScanPart& whole, const BuildConfig& config) {
  float widest = 0;
  for (const LevelRule& rule : make_rules(config, whole, static_cast<float>(whole.area), {}))
    if (!rule.holds_primitives) widest = std::max(widest, primitive_texel(whole.area, rule.level.rho));
  return widest;
}

Rbvh build_part(const Device& device, Scan&& scan, const ScanPart& part, const BuildConfig& config,
                const Progress& progress, BuildTimings* timings) {
  RBVH_CHECK((!config.focus || !part.joined.empty()) && part.own_primitives > 0);
  BuildTimings unasked;
  BuildTimings& time = timings != nullptr ? *timings : unasked;
  time = {};
  Stopwatch watch;
  report(progress, "upload", 0);
  BuildConfig own_config = config;
  own_config.area = part.area;
  const bool has_objects = !scan.object_ids.empty();
  set_apart(scan, part.own_primitives);
  BuildPlan plan = plan_levels(device, scan, part, own_config, {});
  keep_own(scan, part, has_objects);
  time.upload += watch.lap();
  return build_levels(device, scan, part, plan, progress, time);
}

}  // namespace rbvh
