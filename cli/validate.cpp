// rbvh validate: whether a file is whole, and how close a pair's levels are to the scan that they were made
// of.
#include <spdlog/fmt/fmt.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/remedies.h"
#include "cli/stages.h"
#include "cli/views_options.h"
#include "io/image.h"
#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "io/scan_io.h"
#include "io/scene_file.h"
#include "pipeline/measure/measure_json.h"
#include "pipeline/measure/difference.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

struct ValidateOptions {
  std::string file, against;
  std::vector<std::string> levels;  // empty: all
  ViewsConfig views;
  std::string pictures;
  bool as_json = false;
  std::vector<const CLI::Option*> of_pairs;  // options that proxies have no use for
};

Json pair_json(const Rbvh& rbvh) {
  std::uint64_t leaves = 0, texels = 0;
  for (const Level& level : rbvh.levels) {
    leaves += level.leaves.size();
    texels += std::uint64_t{level.atlas_width} * level.atlas_height;
  }
  return {{"kind", "rbvh"}, {"levels", rbvh.levels.size()}, {"leaves", leaves}, {"texels", texels}};
}

void make_folder(const std::string& path) {
  std::error_code code;
  std::filesystem::create_directories(path, code);
  if (code) throw Error(ErrorKind::kFailure, path, "the folder cannot be made: " + code.message());
}

// What the file says of itself stands beside what was found; a warning where it promised more.
void compare_with_stored(Context& context, const std::string& path, const Level& level, const LevelMeasure& m,
                         const ViewsConfig& views, Json& json) {
  json["stored"] = fidelity_json(level.fidelity);
  json["as_stored"] = nullptr;  // only what was measured in the same way can be compared
  const LevelMeasures& stored = level.fidelity.more;
  if (stored.views != static_cast<std::uint32_t>(views.views) || stored.resolution != views.resolution)
    return;
  const std::string difference = find_difference(level.fidelity, stored_fidelity(m, views));
  json["as_stored"] = difference.empty();
  if (!difference.empty())
    warn(context,
         path + ": " + level.name + " has " + difference + "; was it measured against another scan?");
}

Json measure(Context& context, const ValidateOptions& options, const Asset& pair) {
  const Asset exact =
      load_reference(options.against, *pair.rbvh(), context.memory, context.progress.callback());
  if (const auto other = find_other_scan(pair, exact)) warn(context, options.against + ": " + *other);
  const std::vector<std::string> levels = levels_to_cast(
      context, pair, options.levels.empty() ? std::vector<std::string>{"all"} : options.levels);
  MeasureConfig config;
  config.views = options.views;
  config.images = config.distances = true;
  config.memory = context.memory;
  if (!options.pictures.empty()) {
    make_folder(options.pictures);
    config.on_view = [&](const MeasuredView& view) {
      const std::string name = levels[view.level] + "-" + std::to_string(view.view) + ".png";
      write_image((std::filesystem::path(options.pictures) / name).string(),
                  difference_image(view.exact, view.hits, view.rays, exact.bounds.diagonal(), 2),
                  context.force);
    };
  }
  Json list = Json::array();
  const Device device = Device::open(context.device);
  for (const LevelMeasure& m :
       measure_levels(device, pair, exact, levels, config, context.progress.callback())) {
    Json json = measure_json(m);
    compare_with_stored(context, pair.path, *pair.rbvh()->find_level(m.level), m, config.views, json);
    list.push_back(std::move(json));
  }
  return list;
}

// A line for each figure, a column for each level.
std::string fidelity_text(const Json& list) {
  struct Row {
    const char *name, *pointer, *format;
  };
  static const Row kRows[] = {
      {"holes (worst view)", "/worst_view/holes", "{}"},
      {"leaks (worst view)", "/worst_view/leaks", "{}"},
      {"walls (worst view)", "/worst_view/walls", "{}"},
      {"mask mismatch, % of pixels", "/mask_mismatch_percent", "{:.3f}"},
      {"  of it at the silhouette, %", "/mismatch_at_silhouette_percent", "{:.1f}"},
      {"|dt| / diagonal: median", "/dt/median", "{:.1e}"},
      {"  p99", "/dt/p99", "{:.1e}"},
      {"  p99.9", "/dt/p99.9", "{:.1e}"},
      {"normal angle: median, degrees", "/normal_degrees/median", "{:.2f}"},
      {"  p95", "/normal_degrees/p95", "{:.2f}"},
      {"image RMSE", "/image/rmse", "{:.4f}"},
      {"  control: exact, jittered", "/image_control/rmse", "{:.4f}"},
      {"  over the control's", "/image_relative", "{:.2f}"},
      {"image PSNR, dB", "/image/psnr", "{:.1f}"},
      {"  control", "/image_control/psnr", "{:.1f}"},
      {"image SSIM", "/image/ssim", "{:.4f}"},
      {"  control", "/image_control/ssim", "{:.4f}"},
      {"level to scan: rms, % of diagonal", "/level_to_scan/rms_percent", "{:.4f}"},
      {"  max, % of diagonal", "/level_to_scan/max_percent", "{:.3f}"},
      {"  max, texels", "/level_to_scan/max_texels", "{:.1f}"},
      {"scan to level: rms, % of diagonal", "/scan_to_level/rms_percent", "{:.4f}"},
      {"  max, % of diagonal", "/scan_to_level/max_percent", "{:.3f}"},
      {"  max, texels", "/scan_to_level/max_texels", "{:.1f}"},
  };
  std::string text = fmt::format("{:<36}", "");
  for (const Json& f : list) text += fmt::format("{:>10}", f["level"].get<std::string>());
  text += "\n";
  for (const Row& row : kRows) {
    text += fmt::format("{:<36}", row.name);
    for (const Json& f : list) {
      const Json& value = f.at(Json::json_pointer(row.pointer));
      const std::string shown = value.is_null() ? "-"
                                : value.is_number_integer()
                                    ? value.dump()
                                    : fmt::format(fmt::runtime(row.format), value.get<double>());
      text += fmt::format("{:>10}", shown);
    }
    text += "\n";
  }
  return text;
}

Json proxy_json(const Proxy& proxy) {
  std::uint64_t texels = 0;
  for (const PatchTile& tile : proxy.tiles) texels += std::uint64_t{tile.side} * tile.side;
  return {{"kind", "proxy"}, {"patches", proxy.quads.size()}, {"texels", texels}};
}

std::string distance_text(const Json& distance) {
  std::string text;
  for (const auto& [name, value] : distance.items())
    text += fmt::format("{}: rms {:.4f}%, max {:.3f}% of the diagonal\n", name,
                        value["rms_percent"].get<double>(), value["max_percent"].get<double>());
  return text;
}

Json scene_json(const Scene& scene) {
  return {{"kind", "scene"},
          {"objects", scene.objects.size()},
          {"instances", scene.instances.size()},
          {"leaves", first_leaves(scene).back()}};
}

// What is to be said of a file that is whole; throws its first fault.
Json check_file(const Context& context, const std::string& file, const std::optional<Asset>& asset,
                const std::optional<Proxy>& proxy) {
  Json json = {{"file", file}, {"valid", true}};
  if (asset && asset->scene()) {
    json.update(scene_json(*asset->scene()));
  } else if (asset) {
    json.update(pair_json(*asset->rbvh()));
  } else if (proxy) {
    json.update(proxy_json(*proxy));
  } else {
    refuse_proxy(file);
    check_read_budget(context.memory, file);
    const RawScan scan = read_scan(file);
    json.update({{"kind", scan.triangles.empty() ? "cloud" : "mesh"},
                 {"vertices", scan.positions.size()},
                 {"triangles", scan.triangles.size()}});
  }
  return json;
}

std::string file_text(const Json& json) {
  std::string text;
  for (const std::string noun :
       {"object", "instance", "level", "leaf", "patch", "texel", "vertex", "triangle"})
    if (const auto count = json.find(plural(noun)); count != json.end())
      text += (text.empty() ? "" : ", ") + counted(count->get<std::uint64_t>(), noun);
  return json["file"].get<std::string>() + ": whole (" + text + ")\n";
}

void run_validate(Context& context, const ValidateOptions& options) {
  const auto print = [](const Json& json) {
    print_data(json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  };
  const bool is_pair = is_rbvh(options.file), is_of_quads = is_proxy(options.file),
             places = is_scene(options.file);
  if (!is_pair && !is_of_quads && !options.against.empty())
    throw Error(ErrorKind::kUsage, options.file,
                std::string("--against compares the levels of an .rbvh, or a proxy, and this is a ") +
                    (places ? "scene" : "scan"));
  if (!is_pair) refuse_options(options.of_pairs, options.file, "is for pairs, and this is none");
  std::optional<Asset> asset;  // a pair, or a scene with all its files
  std::optional<Proxy> proxy;
  ProxyHeader header;
  Json json;
  try {
    if (is_pair || places) asset = load(context, options.file);
    if (is_of_quads) proxy = load_proxy(options.file, &header);
    json = check_file(context, options.file, asset, proxy);
  } catch (const Error& error) {
    if (options.as_json && error.kind() == ErrorKind::kInput)
      print({{"file", options.file}, {"valid", false}, {"fault", error_line(error)}});
    throw;
  }
  if (!options.as_json) print_data(file_text(json));
  if (proxy && !options.against.empty()) {
    Scan scan = load_scan(options.against, context.memory, context.progress.callback());
    move_to_shift(scan, header.source.shift);
    json["against"] = options.against;
    json["distance"] = proxy_measure_json(measure_proxy(*proxy, scan));
    if (!options.as_json) print_data(distance_text(json["distance"]));
  } else if (!options.against.empty()) {
    json["against"] = options.against;
    json["views"] = options.views.views;
    json["resolution"] = options.views.resolution;
    json["fidelity"] = measure(context, options, *asset);
    if (!options.as_json) print_data(fidelity_text(json["fidelity"]));
  }
  if (options.as_json) print(json);
}

}  // namespace

void add_validate(CLI::App& app, Context& context) {
  const auto options = std::make_shared<ValidateOptions>();
  CLI::App* stage = add_stage(app, context,
                              {"validate", "Check a file; measure a pair or a proxy against its scan",
                               "rbvh validate dragon.rbvh --against dragon.ply"},
                              kWithDevice, [&context, options] { run_validate(context, *options); });
  stage->add_option("FILE", options->file, "an .rbvh, a proxy, a scan (-: standard input) or a scene (.json)")
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
  stage->add_flag("--json", options->as_json, "as JSON");
}

}  // namespace rbvh
