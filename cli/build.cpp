// rbvh build: from an ingested scan to an .rbvh pair.
#include <filesystem>
#include <memory>

#include "cli/common.h"
#include "cli/layer_options.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "cli/views_options.h"
#include "io/hash.h"
#include "io/input_file.h"
#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "io/scan_io.h"
#include "pipeline/measure/measure_json.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/scan/ingest.h"
#include "pipeline/trace/make_tracer.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

// What a build has in memory at its peak, beside the file: the scan and its primitives, and the tiles'
// texels.
constexpr std::uint64_t kBytesPerVertex = 80, kBytesPerPrimitive = 160, kBytesPerTexel = 40;

struct BuildOptions {
  std::string file;
  std::vector<std::string> levels;  // empty: all
  Refinement refinement = Refinement::kProjectedArea;
  SplitRule split = SplitRule::kSpatialMedian;
  PartitionWhere partition = PartitionWhere::kDevice;
  RaysKind rays = RaysKind::kCoherent;
  std::optional<Vec3d> focus, focus_camera;
  std::optional<double> focus_radius;
  std::optional<std::string> focus_level;  // Q0
  std::vector<std::string> layers;         // of the scan's vertex properties
  double layer_scale = 1;
  Hybrid hybrid = Hybrid::kAuto;
  bool measure = false;
  ViewsConfig views;
};

Refinement parse_refinement(std::string_view text) {
  if (text == "area") return Refinement::kProjectedArea;
  if (text == "cone") return Refinement::kConeOfNormals;
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is neither area nor cone");
}

SplitRule parse_split(std::string_view text) {
  if (text == "median") return SplitRule::kSpatialMedian;
  if (text == "sah") return SplitRule::kSurfaceArea;
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is neither median nor sah");
}

PartitionWhere parse_partition(std::string_view text) {
  if (text == "device") return PartitionWhere::kDevice;
  if (text == "host") return PartitionWhere::kHost;
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is neither device nor host");
}

RaysKind parse_rays(std::string_view text) {
  if (text == "coherent") return RaysKind::kCoherent;
  if (text == "incoherent") return RaysKind::kIncoherent;
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is neither coherent nor incoherent");
}

constexpr std::pair<std::string_view, Hybrid> kHybrids[] = {
    {"off", Hybrid::kOff}, {"auto", Hybrid::kAuto}, {"always", Hybrid::kAlways}};

Hybrid parse_hybrid(std::string_view text) {
  for (const auto& [name, hybrid] : kHybrids)
    if (name == text) return hybrid;
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is none of off, auto and always");
}

// Finest first, whatever order they were asked for in.
std::vector<LevelConfig> choose_level_configs(const std::vector<std::string>& names) {
  if (names.empty()) return standard_levels();
  std::vector<LevelConfig> chosen;
  for (const LevelConfig& level : standard_levels())
    if (std::find(names.begin(), names.end(), level.name) != names.end()) chosen.push_back(level);
  for (const std::string& name : names)
    if (std::none_of(chosen.begin(), chosen.end(),
                     [&](const LevelConfig& level) { return level.name == name; }))
      throw Error(ErrorKind::kUsage, "", "there is no level '" + name + "'; there are Q0, Q1, Q2, Q3 and Q4");
  return chosen;
}

double parse_radius(std::string_view text) {
  const double radius = parse_number(text);
  if (!(radius > 0)) throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not above 0");
  return radius;
}

LevelConfig focus_level(const BuildOptions& options) {
  return choose_level_configs({options.focus_level.value_or("Q0")}).front();
}

void check_focus(const BuildOptions& options) {
  const auto refuse = [](const char* what) { throw Error(ErrorKind::kUsage, "", what); };
  if (options.focus && options.focus_camera) refuse("--focus and --focus-camera: one of them is wanted");
  if (options.focus && !options.focus_radius) refuse("--focus: how far around it? Add --focus-radius");
  if (options.focus_radius && !options.focus && !options.focus_camera)
    refuse("--focus-radius: around what? Add --focus or --focus-camera");
  if (options.focus_level && !options.focus && !options.focus_camera)
    refuse("--focus-level: around what? Add --focus or --focus-camera");
  focus_level(options);
}

/// Of a camera: the nearest that it sees has the focus level's quality.
std::optional<Focus> make_focus(const BuildOptions& options, const Scan& scan) {
  if (!options.focus && !options.focus_camera) return {};
  Focus focus;
  focus.center = Vec3f(options.focus ? *options.focus : *options.focus_camera);
  focus.level = focus_level(options);
  if (options.focus_radius) {
    focus.radius = static_cast<float>(*options.focus_radius);
    return focus;
  }
  float nearest = std::numeric_limits<float>::infinity();
  for (const Vec3f& p : scan.positions) nearest = std::min(nearest, length(p - focus.center));
  focus.radius = std::max(nearest, 1e-3f * bounds(scan).diagonal());
  return focus;
}

Scan read_ingested(const std::string& path, std::string_view bytes) {
  Scan scan = shift_to_float(parse_scan(bytes, path));
  check_usable(scan, path);
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    if (!is_finite(scan.positions[i]))
      throw Error(ErrorKind::kInput, path,
                  "vertex " + std::to_string(i) + " is not finite; run rbvh ingest on it first");
  if (scan.is_cloud() && (scan.normals.empty() || scan.radii.empty()))
    throw Error(ErrorKind::kInput, path, "the points have no normals or radii; run rbvh ingest on it first");
  return scan;
}

nlohmann::ordered_json options_json(const BuildOptions& options, const std::vector<LevelConfig>& levels) {
  nlohmann::ordered_json json;
  json["refinement"] = options.refinement == Refinement::kProjectedArea ? "area" : "cone";
  json["split"] = options.split == SplitRule::kSpatialMedian ? "median" : "sah";
  json["partition"] = options.partition == PartitionWhere::kDevice ? "device" : "host";
  json["rays"] = options.rays == RaysKind::kCoherent ? "coherent" : "incoherent";
  if (options.focus || options.focus_camera) {
    const Vec3d at = options.focus ? *options.focus : *options.focus_camera;
    json[options.focus ? "focus" : "focus_camera"] = {at.x, at.y, at.z};
    if (options.focus_radius) json["focus_radius"] = *options.focus_radius;
    json["focus_level"] = focus_level(options).name;
  }
  for (const auto& [name, hybrid] : kHybrids)
    if (hybrid == options.hybrid) json["hybrid"] = name;
  for (const LevelConfig& level : levels) json["levels"].push_back(level.name);
  if (!options.layers.empty()) json["layers"] = options.layers;
  if (!options.layers.empty() && options.layer_scale != 1) json["layer_scale"] = options.layer_scale;
  return json;
}

// Fills in the levels' fidelity.
void measure_pair(Context& context, const Device& device, const ViewsConfig& views, Rbvh& rbvh, Scan& scan) {
  Asset exact, pair;
  exact.bounds = pair.bounds = bounds(scan);
  exact.is_cloud = pair.is_cloud = scan.is_cloud();
  exact.content = std::move(scan);
  pair.content = std::move(rbvh);
  MeasureConfig config;
  config.views = views;
  config.images = config.distances = true;
  config.memory = context.memory;
  const std::vector<LevelMeasure> measures =
      measure_levels(device, pair, exact, choose_levels(pair, {"all"}), config, context.progress.callback());
  scan = std::move(std::get<Scan>(exact.content));
  rbvh = std::move(std::get<Rbvh>(pair.content));
  for (std::size_t i = 0; i < measures.size(); ++i)
    rbvh.levels[i].fidelity = stored_fidelity(measures[i], config.views);
}

void run_build(Context& context, const BuildOptions& options) {
  check_focus(options);
  BuildConfig config;
  config.levels = choose_level_configs(options.levels);
  config.refinement = options.refinement;
  config.split = options.split;
  config.partition = options.partition;
  config.rays = options.rays;
  config.hybrid = options.hybrid;
  check_paths_differ(context, {options.file}, {context.output, atlas_path(context.output)});
  check_pair_output(context);

  Stopwatch watch;
  Scan scan;
  std::uint64_t hash = 0;
  {
    refuse_proxy(options.file);
    const InputBytes bytes = read_input(options.file);
    check_budget(context.memory, bytes.size * 3, options.file, "reading it");
    hash = hash_bytes(bytes.view());
    scan = read_ingested(options.file, bytes.view());
  }
  const std::uint64_t primitives = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  check_budget(context.memory,
               scan.positions.size() * kBytesPerVertex + primitives * kBytesPerPrimitive +
                   static_cast<std::uint64_t>(config.levels.front().rho) * kBytesPerTexel,
               options.file, "building it");
  config.focus = make_focus(options, scan);
  const double load_seconds = watch.lap();

  const Device device = Device::open(context.device);
  BuildTimings timings;
  watch.lap();
  const auto of_file = [&](auto&& work) {  // whose errors do not know where the scan came from
    try {
      return work();
    } catch (const Error& error) {
      throw Error(error.kind(), input_name(options.file), error.what(), error.remedy());
    }
  };
  Rbvh rbvh =
      of_file([&] { return build_rbvh(device, scan, config, context.progress.callback(), &timings); });
  const double build_seconds = watch.lap();
  rbvh.source.name = options.file == "-" ? "stdin" : fs::path(options.file).filename().string();
  rbvh.source.hash = hash;
  for (const std::string& name : options.layers) warn_of_infinite(context, options.file, scan, name);
  of_file([&] {
    add_property_layers(rbvh.levels, scan, options.layers, options.layer_scale, context.progress.callback());
  });
  const double layer_seconds = watch.lap();
  double measure_seconds = 0;
  if (options.measure) {
    measure_pair(context, device, options.views, rbvh, scan);
    measure_seconds = watch.lap();
  }
  rbvh.build_options = options_json(options, config.levels).dump();
  const RbvhBytes bytes = write_rbvh(context.output, rbvh, context.force);
  const double write_seconds = watch.lap();

  auto& report = context.report;
  report["device"] = device_json(device.info());
  report["timings"] = {
      {"load", load_seconds},           {"build", build_seconds},         {"upload", timings.upload},
      {"partition", timings.partition}, {"rasterize", timings.rasterize}, {"pack", timings.pack},
      {"layers", layer_seconds},        {"measure", measure_seconds},     {"write", write_seconds}};
  report["counts"] = {{"vertices", scan.positions.size()}, {"triangles", scan.triangles.size()}};
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
    const Level& level = rbvh.levels[i];
    report["levels"].push_back({{"name", level.name},
                                {"leaves", level.leaves.size()},
                                {"exact_leaves", level.exact_leaves.size()},
                                {"texels", std::uint64_t{level.atlas_width} * level.atlas_height},
                                {"texels_used", level.texels_used},
                                {"seconds", timings.levels[i].seconds},
                                {"fidelity", fidelity_json(level.fidelity)}});
  }
  report_pair(context, context.output, bytes, counted(rbvh.levels.size(), "level"));
}

}  // namespace

void add_build(CLI::App& app, Context& context) {
  const auto options = std::make_shared<BuildOptions>();
  CLI::App* stage = add_stage(
      app, context,
      {"build", "Make an .rbvh pair of an ingested scan", "rbvh build dragon.ply -o dragon.rbvh"},
      kWithOutput | kWithDevice | kWithReport, [&context, options] { run_build(context, *options); });
  stage->add_option("FILE", options->file, "the scan, as ingest writes it (-: standard input)")->required();
  add_parsed(*stage, "--levels", options->levels, parse_list, "Q0,Q2", "which levels (default: all five)");
  add_parsed(*stage, "--refinement", options->refinement, parse_refinement, "HOW",
             "what splits a node: area (projected area, default) or cone (cone of normals)");
  add_parsed(*stage, "--split", options->split, parse_split, "HOW",
             "where a node is split: median (of the longest axis, default) or sah (surface area heuristic)");
  add_parsed(*stage, "--partition", options->partition, parse_partition, "WHERE",
             "what splits the nodes: the device (default), or one core of the host in double precision");
  add_parsed(
      *stage, "--rays", options->rays, parse_rays, "KIND",
      "what tiles are sized for: coherent rays (default) or incoherent ones, which prefer smaller tiles");
  add_parsed(*stage, "--focus", options->focus, parse_vec3, "x,y,z",
             "a point of interest, in the scan's coordinates: every level is finer there");
  add_parsed(
      *stage, "--focus-radius", options->focus_radius, parse_radius, "R",
      "within it quality is the focus level's; beyond, texels grow with the distance up to the level's own");
  add_parsed(*stage, "--focus-level", options->focus_level, parse_layer_name, "Q0",
             "the quality there (default: Q0)");
  add_parsed(*stage, "--focus-camera", options->focus_camera, parse_vec3, "x,y,z",
             "the same seen from a camera: what is nearest to it has the focus level's quality");
  add_parsed(*stage, "--layer", options->layers, parse_layer_names, "NAME,NAME",
             "make layers of these properties of the scan's vertices");
  add_parsed(*stage, "--layer-scale", options->layer_scale, parse_layer_scale, "S",
             "their texels to one of the heights', 0.0625 to 16 (default: 1)")
      ->needs("--layer");
  add_parsed(*stage, "--hybrid", options->hybrid, parse_hybrid, "WHEN",
             "which leaves keep their triangles or discs: off (none), auto (where tiles are faulty or more "
             "bytes, default), always");
  stage->add_flag(
      "--measure", options->measure,
      "compare each level with the scan in 8 views and store what is found (see validate --against)");
  add_views_options(*stage, options->views, "--measure");
}

}  // namespace rbvh
