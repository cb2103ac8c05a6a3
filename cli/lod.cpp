// rbvh lod: a smaller pair of a pair, by levels, bytes or error.
#include "pipeline/rbvh/lod.h"
#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "cli/views_options.h"
#include "io/report_json.h"
#include "io/smaller_pair.h"

namespace rbvh {
namespace {

struct LodOptions {
  std::string file;
  LodConfig lod;
};

void run_lod(Context& context, const LodOptions& options) {
  LodConfig config = options.lod;
  if (config.levels.empty() && config.dropped.empty() && !config.most_bytes && !config.most_error)
    throw Error(ErrorKind::kUsage, "", "say which levels: --levels, --drop, --max-bytes or --max-error");
  check_paths_differ(context, {options.file, atlas_path(options.file), config.against},
                     {context.output, atlas_path(context.output)});
  check_pair_output(context);
  check_is_pair(options.file);
  config.memory = context.memory;
  config.overwrite = context.force;
  Asset pair = load(context, options.file);
  time_phase(context, "load");
  const LodReport done = write_smaller_pair(
      pair, context.output, config,
      {.open_device = [&] { return open_device(context); },
       .progress = context.progress.callback(),
       .on_note = [&](const std::string& line) { note(context, "rbvh lod: " + line); },
       .on_phase = [&](std::string_view phase, double seconds) { add_time(context, phase, seconds); }});
  if (!done.unmeasured.empty())
    note(context,
         "rbvh lod: " + done.unmeasured +
             " is chosen by the error that it was built for, or that build sampled where that is larger; "
             "it was not measured (--against SCAN does that)");
  context.report["levels"] = levels_json(*pair.rbvh(), done.bytes);
  report_pair(context, context.output, done.bytes, level_names(*pair.rbvh()));
}

}  // namespace

void add_lod(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(app, context,
                                          {"lod", "Make a smaller pair: fewer or coarser levels",
                                           "rbvh lod dragon.rbvh --max-bytes 2MB -o small.rbvh"},
                                          kWithOutput | kWithDevice | kWithReport, run_lod);
  stage->add_option("FILE", options->file, "an .rbvh pair")->required();
  add_parsed(*stage, "--levels", options->lod.levels, parse_list, "Q1,Q3",
             "keep these; one that is not there is derived from the finest");
  add_parsed(*stage, "--drop", options->lod.dropped, parse_list, "Q0", "keep all but these");
  add_parsed(
      *stage, "--max-bytes", options->lod.most_bytes, parse_file_size, "SIZE",
      "the finest levels that fit into both files together, such as 2MB (exit 5: none); where even the "
      "coarsest is too large, coarser ones are derived");
  add_parsed(
      *stage, "--max-error", options->lod.most_error, parse_error_bound, "0.01%",
      "the smallest level whose surface distance (rms, the larger of both ways) is within: in % of the "
      "diagonal (also without a unit), mm, cm, m, km, in, ft, or units (the scan's); as build "
      "--measure or --against found it, else as the level was built for");
  stage
      ->add_option("--against", options->lod.against,
                   "the scan: measures the levels that were not measured yet")
      ->type_name("SCAN");
  add_views_options(*stage, options->lod.views, "--against");
}

}  // namespace rbvh
