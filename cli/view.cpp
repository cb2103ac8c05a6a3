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
#include "pipeline/base/text.h"
#include "rbvh/render.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kStillPixels = 512;

struct ViewOptions {
  std::string file;
  std::vector<std::string> levels;
  std::optional<std::uint64_t> most_bytes;
  bool thumbnail = false;
};

Image draw_still(Context& context, const Asset& pair) {
  const Device device = Device::open(context.device);
  context.report["device"] = device_json(device.info());
  RenderConfig config;
  config.width = config.height = kStillPixels;
  config.up = static_cast<Vec3f>(pair.up_axis());
  TracerConfig finest;
  finest.level = level_names(pair).front();
  const std::unique_ptr<Tracer> tracer = make_tracer(device, pair, finest);
  const Bounds3f& b = pair.bounds;
  const Bounds3d bounds{static_cast<Vec3d>(b.lo), static_cast<Vec3d>(b.hi)};
  return render(*tracer, place_camera({}, bounds, pair.up_axis(), 1), config);
}

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
  if (options.thumbnail) config.still = draw_still(context, pair);
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
  const auto options = std::make_shared<ViewOptions>();
  CLI::App* stage = add_stage(app, context,
                              {"view", "Write a pair as one HTML page that shows it in a browser",
                               "rbvh view dragon.rbvh --max-bytes 3MB -o dragon.html"},
                              kWithOutput | kWithDevice | kWithReport,
                              [&context, options] { run_view(context, *options); });
  stage->add_option("PAIR", options->file, "an .rbvh pair")->required();
  add_level_option(*stage, options->levels, true);
  add_parsed(*stage, "--max-bytes", options->most_bytes, parse_file_size, "SIZE",
             "the finest levels that fit into a page of so many bytes, such as 3MB (exit 5: none)");
  stage->add_flag("--thumbnail", options->thumbnail,
                  "draws a picture into the page, which is seen before scripts run and where they cannot");
}

}  // namespace rbvh
