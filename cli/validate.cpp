// rbvh validate: whether a file is whole, and how close a pair's levels are to the scan that they were made
// of.
#include <optional>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/remedies.h"
#include "cli/stages.h"
#include "cli/views_options.h"
#include "io/check_file.h"
#include "io/difference_pictures.h"
#include "io/parts_file.h"
#include "io/report_text.h"
#include "io/scene_file.h"
#include "pipeline/measure/measure_json.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

struct ValidateOptions {
  std::vector<std::string> files;
  std::string against;
  std::vector<std::string> levels;  // empty: all
  ViewsConfig views;
  std::string pictures;
  bool as_json = false;
  std::vector<const CLI::Option*> of_pairs;  // options that proxies have no use for
};

Json measure(Context& context, const ValidateOptions& options, const Asset& pair) {
  const Asset exact =
      load_reference(options.against, *pair.rbvh(), context.memory, context.progress.callback());
  if (const auto other = find_other_scan(pair, exact)) warn(context, options.against + ": " + *other);
  const std::vector<std::string> levels = levels_to_cast(context, pair, or_all(options.levels));
  MeasureConfig config;
  config.views = options.views;
  config.images = config.distances = true;
  config.memory = context.memory;
  if (!options.pictures.empty())
    config.on_view = difference_writer(options.pictures, levels, exact.bounds.diagonal(), context.force);
  Json list = Json::array();
  const Device device = Device::open(context.device);
  for (const LevelMeasure& m :
       measure_levels(device, pair, exact, levels, config, context.progress.callback())) {
    std::string difference;
    list.push_back(measure_json(m, config.views, *pair.rbvh()->find_level(m.level), difference));
    if (!difference.empty())
      warn(context,
           pair.path + ": " + m.level + " has " + difference + "; was it measured against another scan?");
  }
  return list;
}

void validate_file(Context& context, const ValidateOptions& options, const std::string& path) {
  const bool is_pair = is_rbvh(path) && !is_parts(path);
  if (!is_pair && !is_proxy(path) && !options.against.empty())
    throw Error(ErrorKind::kUsage, path,
                std::string("--against compares the levels of an .rbvh, or a proxy, and this is a ") +
                    (is_parts(path)   ? "pair of parts"
                     : is_scene(path) ? "scene"
                                      : "scan"));
  if (!is_pair) refuse_options(options.of_pairs, path, "is for pairs, and this is none");
  CheckedFile file;
  try {
    file = check_file(path, {.memory = context.memory, .tessellate = {}}, context.progress.callback());
  } catch (const Error& error) {
    if (options.as_json && error.kind() == ErrorKind::kInput)
      print_json({{"file", path}, {"valid", false}, {"fault", error_line(error)}});
    throw;
  }
  Json& json = file.summary;
  if (!options.as_json) print_data(file_line(json));
  if (file.proxy && !options.against.empty()) {
    Scan scan = load_scan(options.against, context.memory, context.progress.callback());
    move_to_shift(scan, file.proxy_header.source.shift);
    json["against"] = options.against;
    json["distance"] = proxy_measure_json(measure_proxy(*file.proxy, scan));
    if (!options.as_json) print_data(distance_text(json["distance"]));
  } else if (!options.against.empty()) {
    json["against"] = options.against;
    json["views"] = options.views.views;
    json["resolution"] = options.views.resolution;
    json["fidelity"] = measure(context, options, *file.asset);
    if (!options.as_json) print_data(fidelity_table(json["fidelity"]));
  }
  if (options.as_json) print_json(json);
}

void run_validate(Context& context, const ValidateOptions& options) {
  if (options.files.size() > 1 && !options.against.empty())
    throw Error(ErrorKind::kUsage, options.files[1], "--against measures one file; name that alone");
  for_each_file(context, options.files,
                [&](const std::string& path) { validate_file(context, options, path); });
}

}  // namespace

void add_validate(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"validate", "Check a file; measure a pair or a proxy against its scan",
                 "rbvh validate dragon.rbvh --against dragon.ply"},
                kWithDevice, run_validate);
  stage
      ->add_option("FILE", options->files,
                   ".rbvh pairs, proxies, scans (-: standard input) or scenes (.json)")
      ->required();
  stage
      ->add_option("--against", options->against,
                   "the scan: casts the same rays at both, from views around the object")
      ->type_name("SCAN");
  add_level_option(*stage, options->levels, true)->needs("--against");
  add_views_options(*stage, options->views, "--against");
  stage
      ->add_option("--pictures", options->pictures,
                   "a folder for pictures of the differences, <level>-<view>.png")
      ->needs("--against")
      ->type_name("FOLDER");
  for (const char* name : {"--level", "--views", "--resolution", "--pictures"})
    options->of_pairs.push_back(stage->get_option(name));
  stage->add_flag("-f,--force", context.force, "overwrite pictures that are there");
  stage->add_flag("--json", options->as_json, "as JSON; of several files, one object after the other");
}

}  // namespace rbvh
