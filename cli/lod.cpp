// rbvh lod: a smaller pair of a pair, by levels, bytes or error.
#include <spdlog/fmt/fmt.h>

#include <functional>
#include <optional>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "cli/views_options.h"
#include "io/rbvh_file.h"
#include "io/report_json.h"
#include "pipeline/base/error_bound.h"
#include "pipeline/measure/stored_fidelity.h"
#include "pipeline/rbvh/level_mesh.h"
#include "pipeline/rbvh/lod.h"

namespace rbvh {
namespace {

struct LodOptions {
  std::string file, against;
  std::vector<std::string> levels, dropped;
  std::optional<std::uint64_t> most_bytes;
  std::optional<ErrorBound> most_error;
  ViewsConfig views;
};

// Opened where a level has to be derived or measured.
const Device& open_once(Context& context, std::optional<Device>& device) {
  if (!device) device = open_device(context);
  return *device;
}

// With the scan at hand, what has not been measured is.
void measure(Context& context, const LodOptions& options, std::optional<Device>& device, Asset& pair) {
  const std::vector<std::string> levels = unmeasured_levels(*pair.rbvh());
  if (levels.empty()) return;
  const Asset exact =
      load_reference(options.against, *pair.rbvh(), context.memory, context.progress.callback());
  // A warning would not do: the pair would keep the figures for good.
  if (const auto other = find_other_scan(pair, exact))
    throw Error(ErrorKind::kInput, options.against, *other);
  measure_and_store(open_once(context, device), pair, exact, levels, options.views, context.memory,
                    context.progress.callback());
}

std::string choose_by_error(Context& context, const LodOptions& options, const Rbvh& rbvh) {
  const std::vector<std::string> unmeasured = unmeasured_levels(rbvh);
  if (!options.against.empty() && !unmeasured.empty())
    throw Error(ErrorKind::kInput, options.file,
                "level " + unmeasured.front() + " and " + options.against +
                    " are hit by no ray both; is it another scan?");
  const double diagonal = static_cast<double>(rbvh.source.bounds.diagonal());
  const double most = part_of_diagonal(*options.most_error, "%", {diagonal, rbvh.source.units}, options.file);
  const Level& level = choose_level_by_error(rbvh, 100 * most, options.file);
  if (!known_error(rbvh, level).is_measured)
    note(context,
         "rbvh lod: " + level.name +
             " is chosen by the error that it was built for, or that build sampled where that is larger; "
             "it was not measured (--against SCAN does that)");
  return level.name;
}

void run_lod(Context& context, const LodOptions& options) {
  if (options.levels.empty() && options.dropped.empty() && !options.most_bytes && !options.most_error)
    throw Error(ErrorKind::kUsage, "", "say which levels: --levels, --drop, --max-bytes or --max-error");
  check_paths_differ(context, {options.file, atlas_path(options.file), options.against},
                     {context.output, atlas_path(context.output)});
  check_pair_output(context);
  check_is_pair(options.file);
  Asset pair = load(context, options.file);
  Rbvh& rbvh = *pair.rbvh();
  time_phase(context, "load");

  std::optional<Device> device;
  const Level finest = rbvh.levels.front();  // that came in: what others are derived from
  const auto derive = [&](Rbvh& to, const std::vector<LevelConfig>& levels) {
    if (levels.empty()) return;
    if (!keeps_objects(finest, pair.is_cloud))
      note(context,
           fmt::format("rbvh lod: what is derived from {} is one object: its tiles are joined to one mesh, "
                       "and its {} objects are not kept apart",
                       finest.name, objects_of(finest).size()));
    add_derived_levels(open_once(context, device), to, finest, levels, context.progress.callback());
  };
  const LevelChoice choice = choose_levels_by_name(rbvh, options.levels, options.dropped, options.file);
  derive(rbvh, choice.derived);
  keep_levels(rbvh, choice.names);
  if (!options.against.empty()) measure(context, options, device, pair);
  if (options.most_error) keep_levels(rbvh, {choose_by_error(context, options, rbvh)});
  time_phase(context, "levels");

  std::function<void(Rbvh&)> add_coarser;
  if (options.levels.empty() && !options.most_error)
    add_coarser = [&](Rbvh& to) { derive(to, derivable_levels(to, to.levels.back())); };
  const RbvhBytes bytes = options.most_bytes
                              ? write_rbvh_within(context.output, rbvh, context.force, *options.most_bytes,
                                                  options.file, add_coarser)
                              : write_rbvh(context.output, rbvh, context.force);
  time_phase(context, "write");
  context.report["levels"] = levels_json(rbvh, bytes);
  report_pair(context, context.output, bytes, level_names(rbvh));
}

}  // namespace

void add_lod(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(app, context,
                                          {"lod", "Make a smaller pair: fewer or coarser levels",
                                           "rbvh lod dragon.rbvh --max-bytes 2MB -o small.rbvh"},
                                          kWithOutput | kWithDevice | kWithReport, run_lod);
  stage->add_option("FILE", options->file, "an .rbvh pair")->required();
  add_parsed(*stage, "--levels", options->levels, parse_list, "Q1,Q3",
             "keep these; one that is not there is derived from the finest");
  add_parsed(*stage, "--drop", options->dropped, parse_list, "Q0", "keep all but these");
  add_parsed(
      *stage, "--max-bytes", options->most_bytes, parse_file_size, "SIZE",
      "the finest levels that fit into both files together, such as 2MB (exit 5: none); where even the "
      "coarsest is too large, coarser ones are derived");
  add_parsed(
      *stage, "--max-error", options->most_error, parse_error_bound, "0.01%",
      "the smallest level whose surface distance (rms, the larger of both ways) is within: in % of the "
      "diagonal (also without a unit), mm, cm, m, km, in, ft, or units (the scan's); as build "
      "--measure or --against found it, else as the level was built for");
  stage->add_option("--against", options->against, "the scan: measures the levels that were not measured yet")
      ->type_name("SCAN");
  add_views_options(*stage, options->views, "--against");
}

}  // namespace rbvh
