// rbvh validate: whether a file is whole, and how close a pair's levels are to the scan that they were made
// of.
#include <spdlog/fmt/fmt.h>

#include <memory>
#include <optional>

#include "cli/common.h"
#include "cli/stages.h"
#include "cli/subject.h"
#include "io/rbvh_file.h"
#include "io/scan_io.h"
#include "pipeline/rbvh/fidelity.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

struct ValidateOptions {
  std::string file, against;
  std::vector<std::string> levels;  // empty: all
  ViewsConfig views;
  bool as_json = false;
};

std::uint32_t parse_side(std::string_view text) {
  const std::int64_t side = parse_integer(text);
  if (side < 16 || side > 16384)
    throw Error(ExitCode::kUsage, "", "'" + std::string(text) + "' is not between 16 and 16384 pixels");
  return static_cast<std::uint32_t>(side);
}

Json pair_json(const Rbvh& rbvh) {
  std::uint64_t leaves = 0, texels = 0;
  for (const Level& level : rbvh.levels) {
    leaves += level.leaves.size();
    texels += std::uint64_t{level.atlas_width} * level.atlas_height;
  }
  return {{"kind", "rbvh"}, {"levels", rbvh.levels.size()}, {"leaves", leaves}, {"texels", texels}};
}

// Into the pair's coordinates, where the scan was read with another shift: an ingested scan's own may differ
// from that of the file it came from.
void move_to_shift(Scan& scan, const Vec3d& shift) {
  if (scan.shift == shift) return;
  const Vec3d difference = scan.shift - shift;
  for (Vec3f& p : scan.positions) p = Vec3f(Vec3d(p) + difference);
  scan.shift = shift;
}

Json distribution_json(const Distribution& d) {
  return {{"median", d.median}, {"p95", d.p95}, {"p99", d.p99}, {"p99.9", d.p999}, {"max", d.max}};
}

Json fidelity_json(const std::string& level, const ViewsFidelity& f) {
  return {{"level", level},
          {"pixels", f.all.pixels},
          {"holes", f.all.holes},
          {"leaks", f.all.leaks},
          {"walls", f.all.walls},
          {"worst_view", {{"holes", f.worst_holes}, {"leaks", f.worst_leaks}, {"walls", f.worst_walls}}},
          {"mask_mismatch_percent", f.all.mismatch_percent()},
          {"mismatch_at_silhouette_percent", f.all.silhouette_percent()},
          {"dt", distribution_json(f.all.dt)},
          {"normal_degrees", distribution_json(f.all.normal_degrees)}};
}

Json measure(Context& context, const ValidateOptions& options, const Subject& pair) {
  Subject exact;
  exact.path = options.against;
  Scan scan = load_exact_scan(context, options.against);
  move_to_shift(scan, pair.rbvh()->source.shift);
  exact.bounds = bounds(scan);
  exact.is_cloud = scan.is_cloud();
  exact.content = std::move(scan);
  const std::vector<std::string> levels =
      choose_levels(pair, options.levels.empty() ? std::vector<std::string>{"all"} : options.levels);

  const Device device = Device::open(context.device);
  const Caster exact_caster = make_caster(device, exact, "exact");
  ViewsConfig config = options.views;
  config.up_axis = exact.up_axis();
  Json list = Json::array();
  for (const std::string& level : levels) {
    const Caster caster = make_caster(device, pair, level);
    list.push_back(fidelity_json(
        level, measure_views([&](const CameraRays& rays) { return cast_camera(exact_caster, rays); },
                             [&](const CameraRays& rays) { return cast_camera(caster, rays); }, exact.bounds,
                             config, context.progress.callback())));
  }
  return list;
}

std::string fidelity_text(const Json& list) {
  std::string text =
      "level   worst view: holes leaks walls   mismatch (at silhouette)   |dt|/diagonal: median     p99   "
      "p99.9"
      "   normal: median    p95\n";
  for (const Json& f : list)
    text += fmt::format(
        "{:<6} {:>18} {:>5} {:>5} {:>8.3g}% {:>12.3g}% {:>22.2e} {:>7.1e} {:>7.1e} {:>13.2f} deg {:>4.1f} "
        "deg\n",
        f["level"].get<std::string>(), f["worst_view"]["holes"].dump(), f["worst_view"]["leaks"].dump(),
        f["worst_view"]["walls"].dump(), f["mask_mismatch_percent"].get<double>(),
        f["mismatch_at_silhouette_percent"].get<double>(), f["dt"]["median"].get<double>(),
        f["dt"]["p99"].get<double>(), f["dt"]["p99.9"].get<double>(),
        f["normal_degrees"]["median"].get<double>(), f["normal_degrees"]["p95"].get<double>());
  return text;
}

// What is to be said of a file that is whole; throws its first fault.
Json check_file(const std::string& file, const std::optional<Subject>& pair) {
  Json json = {{"file", file}, {"valid", true}};
  if (pair) {
    json.update(pair_json(*pair->rbvh()));
  } else {
    const RawScan scan = read_scan(file);
    json.update({{"kind", scan.triangles.empty() ? "cloud" : "mesh"},
                 {"vertices", scan.positions.size()},
                 {"triangles", scan.triangles.size()}});
  }
  return json;
}

std::string file_text(const Json& json) {
  std::string text;
  for (const auto& [name, value] : json.items())
    if (value.is_number()) text += (text.empty() ? "" : ", ") + value.dump() + " " + name;
  return json["file"].get<std::string>() + ": whole (" + text + ")\n";
}

void run_validate(Context& context, const ValidateOptions& options) {
  const auto print = [](const Json& json) {
    print_data(json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  };
  const bool is_pair = is_rbvh(options.file);
  if (!is_pair && !options.against.empty())
    throw Error(ExitCode::kUsage, options.file,
                "--against compares the levels of an .rbvh, and this is a scan");
  std::optional<Subject> pair;
  Json json;
  try {
    if (is_pair) pair = load_subject(context, options.file);
    json = check_file(options.file, pair);
  } catch (const Error& error) {
    if (options.as_json && error.code() == ExitCode::kInput)
      print({{"file", options.file}, {"valid", false}, {"fault", error.what()}});
    throw;
  }
  if (!options.as_json) print_data(file_text(json));
  if (!options.against.empty()) {
    json["against"] = options.against;
    json["views"] = options.views.views;
    json["resolution"] = options.views.resolution;
    json["fidelity"] = measure(context, options, *pair);
    if (!options.as_json) print_data(fidelity_text(json["fidelity"]));
  }
  if (options.as_json) print(json);
}

}  // namespace

void add_validate(CLI::App& app, Context& context) {
  const auto options = std::make_shared<ValidateOptions>();
  CLI::App* stage = add_stage(app, context,
                              {"validate", "Check a file; measure a pair against its scan",
                               "rbvh validate dragon.rbvh --against dragon.ply"},
                              kWithDevice, [&context, options] { run_validate(context, *options); });
  stage->add_option("FILE", options->file, "an .rbvh, or a scan (-: standard input)")->required();
  stage
      ->add_option("--against", options->against,
                   "the scan: casts the same rays at both, from views around the object")
      ->type_name("SCAN");
  add_level_option(*stage, options->levels, true);
  add_parsed(*stage, "--views", options->views.views, parse_positive, "N", "how many views (default: 8)");
  add_parsed(*stage, "--resolution", options->views.resolution, parse_side, "N",
             "pixels of a view, both ways (default: 1024)");
  stage->add_flag("--json", options->as_json, "as JSON");
}

}  // namespace rbvh
