// rbvh view: a pair as one HTML page that ray casts it.
#include "rbvh/viewer.h"

#include <spdlog/fmt/fmt.h>

#include <memory>
#include <optional>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/stages.h"
#include "io/output_file.h"
#include "io/report_json.h"
#include "io/report_text.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

struct ViewOptions {
  std::string file;
  std::vector<std::string> levels;
  std::optional<std::uint64_t> most_bytes;
  bool thumbnail = false;
};

void run_view(Context& context, const ViewOptions& options) {
  check_paths_differ(context, {options.file}, {context.output});
  check_output(context.output, context.force);
  check_is_pair(options.file);
  LoadConfig levels;
  if (!options.levels.empty()) levels.levels = options.levels;
  const Asset pair = load(context, options.file, levels);
  time_phase(context, "load");
  ViewConfig config;
  config.most_bytes = options.most_bytes.value_or(config.most_bytes);
  if (options.thumbnail) config.still = draw_still(open_device(context), pair);
  time_phase(context, "thumbnail");
  const ViewBytes bytes = write_view(context.output, pair, config, context.force);
  time_phase(context, "write");
  std::string names;
  for (std::size_t i = 0; i < bytes.levels.size(); ++i) {
    names += (i > 0 ? ", " : "") + bytes.levels[i];
    context.report["levels"].push_back({{"name", bytes.levels[i]},
                                        {"bytes", bytes.level_bytes[i]},
                                        {"stored_bytes", bytes.stored_bytes[i]}});
  }
  context.report["bytes"] = bytes.page;
  note(context, fmt::format("rbvh view: wrote {} ({}, {})", context.output, names, format_bytes(bytes.page)));
}

}  // namespace

void add_view(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(app, context,
                                          {"view", "Write a pair as one HTML page that shows it in a browser",
                                           "rbvh view dragon.rbvh --max-bytes 3MB -o dragon.html"},
                                          kWithOutput | kWithDevice | kWithReport, run_view);
  stage->add_option("PAIR", options->file, "an .rbvh pair")->required();
  add_level_option(*stage, options->levels, true);
  add_parsed(*stage, "--max-bytes", options->most_bytes, parse_file_size, "SIZE",
             "the finest levels that fit into a page of so many bytes, such as 3MB (exit 5: none)");
  stage->add_flag("--thumbnail", options->thumbnail,
                  "draws a picture into the page, which is seen before scripts run and where they cannot");
}

}  // namespace rbvh
