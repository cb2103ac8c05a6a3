#include "io/smaller_pair.h"

#include <utility>

#include "io/load_asset.h"
#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/measure/stored_fidelity.h"
#include "pipeline/rbvh/level_mesh.h"
#include "pipeline/rbvh/lod.h"
#include "pipeline/scene/asset_content.h"

namespace rbvh {
namespace {

/// The pair under way.
struct Lod {
  Asset& pair;
  const LodConfig& config;
  const LodObserver& observer;
  const Level finest = pair.rbvh()->levels.front();  // that came in: what others are derived from
  std::optional<Device> device{};

  const Device& open_once() {
    if (!device) device = observer.open_device();
    return *device;
  }
};

void derive(Lod& lod, const std::vector<LevelConfig>& levels) {
  if (levels.empty()) return;
  if (!keeps_objects(lod.finest, lod.pair.is_cloud) && lod.observer.on_note)
    lod.observer.on_note("what is derived from " + lod.finest.name +
                         " is one object: its tiles are joined to one mesh, and its " +
                         std::to_string(objects_of(lod.finest).size()) + " objects are not kept apart");
  add_derived_levels(lod.open_once(), *lod.pair.rbvh(), lod.finest, levels, lod.observer.progress);
}

/// With the scan at hand, what has not been measured is.
void measure(Lod& lod) {
  const LodConfig& config = lod.config;
  const std::vector<std::string> levels = unmeasured_levels(*lod.pair.rbvh());
  if (levels.empty()) return;
  const Asset exact = load_reference(config.against, *lod.pair.rbvh(), config.memory, lod.observer.progress);
  // A warning would not do: the pair would keep the figures for good.
  if (const auto other = find_other_scan(lod.pair, exact))
    throw Error(ErrorKind::kInput, config.against, *other);
  measure_and_store(lod.open_once(), lod.pair, exact, levels, config.views, config.memory,
                    lod.observer.progress);
}

const Level& choose_by_error(const Lod& lod) {
  const Rbvh& rbvh = *lod.pair.rbvh();
  const std::string& file = lod.pair.path;
  const std::vector<std::string> unmeasured = unmeasured_levels(rbvh);
  if (!lod.config.against.empty() && !unmeasured.empty())
    throw Error(ErrorKind::kInput, file,
                "level " + unmeasured.front() + " and " + lod.config.against +
                    " are hit by no ray both; is it another scan?");
  const ErrorScale scale{static_cast<double>(rbvh.source.bounds.diagonal()), rbvh.source.units};
  return choose_level_by_error(rbvh, 100 * part_of_diagonal(*lod.config.most_error, "%", scale, file), file);
}

}  // namespace

LodReport write_smaller_pair(Asset& pair, const std::string& output, const LodConfig& config,
                             const LodObserver& observer) {
  Stopwatch watch;
  const auto end_phase = [&](std::string_view phase) {
    if (observer.on_phase) observer.on_phase(phase, watch.lap());
  };
  Rbvh& rbvh = *pair.rbvh();
  Lod lod{pair, config, observer};
  const LevelChoice choice = choose_levels_by_name(rbvh, config.levels, config.dropped, pair.path);
  derive(lod, choice.derived);
  keep_levels(rbvh, choice.names);
  if (!config.against.empty()) measure(lod);
  LodReport report;
  if (config.most_error) {
    const Level& level = choose_by_error(lod);
    if (!known_error(rbvh, level).is_measured) report.unmeasured = level.name;
    keep_levels(rbvh, {level.name});
  }
  end_phase("levels");

  std::function<void(Rbvh&)> add_coarser;
  if (config.levels.empty() && !config.most_error)
    add_coarser = [&](Rbvh& to) { derive(lod, derivable_levels(to, to.levels.back())); };
  report.bytes = config.most_bytes ? write_rbvh_within(output, rbvh, config.overwrite, *config.most_bytes,
                                                       pair.path, add_coarser)
                                   : write_rbvh(output, rbvh, config.overwrite);
  end_phase("write");
  return report;
}

}  // namespace rbvh
