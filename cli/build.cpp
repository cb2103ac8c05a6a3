// rbvh build: from an ingested scan to an .rbvh pair.
#include <filesystem>
#include <memory>

#include "cli/common.h"
#include "cli/measure.h"
#include "cli/stages.h"
#include "io/hash.h"
#include "io/input_file.h"
#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "io/scan_io.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/scan/ingest.h"

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
  Hybrid hybrid = Hybrid::kAuto;
  bool measure = false;
};

Refinement parse_refinement(std::string_view text) {
  if (text == "area") return Refinement::kProjectedArea;
  if (text == "cone") return Refinement::kConeOfNormals;
  throw Error(ExitCode::kUsage, "", "'" + std::string(text) + "' is neither area nor cone");
}

constexpr std::pair<std::string_view, Hybrid> kHybrids[] = {
    {"off", Hybrid::kOff}, {"auto", Hybrid::kAuto}, {"always", Hybrid::kAlways}};

Hybrid parse_hybrid(std::string_view text) {
  for (const auto& [name, hybrid] : kHybrids)
    if (name == text) return hybrid;
  throw Error(ExitCode::kUsage, "", "'" + std::string(text) + "' is none of off, auto and always");
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
      throw Error(ExitCode::kUsage, "",
                  "--levels: there is no level '" + name + "'; there are Q0, Q1, Q2, Q3 and Q4");
  return chosen;
}

Scan read_ingested(const std::string& path, std::string_view bytes) {
  Scan scan = shift_to_float(parse_scan(bytes, path));
  check_usable(scan, path);
  for (std::size_t i = 0; i < scan.positions.size(); ++i)
    if (!is_finite(scan.positions[i]))
      throw Error(ExitCode::kInput, path,
                  "vertex " + std::to_string(i) + " is not finite; run rbvh ingest on it first");
  if (scan.is_cloud() && (scan.normals.empty() || scan.radii.empty()))
    throw Error(ExitCode::kInput, path, "the points have no normals or radii; run rbvh ingest on it first");
  return scan;
}

nlohmann::ordered_json options_json(const BuildOptions& options, const std::vector<LevelConfig>& levels) {
  nlohmann::ordered_json json;
  json["refinement"] = options.refinement == Refinement::kProjectedArea ? "area" : "cone";
  for (const auto& [name, hybrid] : kHybrids)
    if (hybrid == options.hybrid) json["hybrid"] = name;
  for (const LevelConfig& level : levels) json["levels"].push_back(level.name);
  return json;
}

// Fills in the levels' fidelity; gives the scan back.
Scan measure_pair(Context& context, const Device& device, Rbvh& rbvh, Scan&& scan) {
  Subject exact, pair;
  exact.bounds = pair.bounds = bounds(scan);
  exact.is_cloud = pair.is_cloud = scan.is_cloud();
  exact.content = std::move(scan);
  pair.content = std::move(rbvh);
  const std::vector<LevelMeasure> measures =
      measure_levels(context, device, pair, exact, choose_levels(pair, {"all"}), {});
  rbvh = std::move(std::get<Rbvh>(pair.content));
  for (std::size_t i = 0; i < measures.size(); ++i)
    rbvh.levels[i].fidelity = stored_fidelity(measures[i].views);
  return std::move(std::get<Scan>(exact.content));
}

void run_build(Context& context, const BuildOptions& options) {
  BuildConfig config;
  config.levels = choose_level_configs(options.levels);
  config.refinement = options.refinement;
  config.hybrid = options.hybrid;
  check_paths_differ(context, {options.file}, {context.output, atlas_path(context.output)});
  check_rbvh_output(context.output, context.force);

  Stopwatch watch;
  Scan scan;
  std::uint64_t hash = 0;
  {
    refuse_proxy(options.file);
    const InputBytes bytes = read_input(options.file);
    check_budget(context, bytes.size * 3, options.file, "reading it");
    hash = hash_bytes(bytes.view());
    scan = read_ingested(options.file, bytes.view());
  }
  const std::uint64_t primitives = scan.is_cloud() ? scan.positions.size() : scan.triangles.size();
  check_budget(context,
               scan.positions.size() * kBytesPerVertex + primitives * kBytesPerPrimitive +
                   static_cast<std::uint64_t>(config.levels.front().rho) * kBytesPerTexel,
               options.file, "building it");
  const double load_seconds = watch.lap();

  const Device device = Device::open(context.device);
  BuildTimings timings;
  watch.lap();
  Rbvh rbvh = build_rbvh(device, scan, config, context.progress.callback(), &timings);
  const double build_seconds = watch.lap();
  rbvh.source.name = options.file == "-" ? "stdin" : fs::path(options.file).filename().string();
  rbvh.source.hash = hash;
  double measure_seconds = 0;
  if (options.measure) {
    scan = measure_pair(context, device, rbvh, std::move(scan));
    measure_seconds = watch.lap();
  }
  rbvh.build_options = options_json(options, config.levels).dump();
  const RbvhBytes bytes = write_rbvh(context.output, rbvh, context.force);
  const double write_seconds = watch.lap();

  auto& report = context.report;
  report["device"] = device_json(device.info());
  report["timings"] = {{"load", load_seconds},           {"build", build_seconds},
                       {"upload", timings.upload},       {"partition", timings.partition},
                       {"rasterize", timings.rasterize}, {"pack", timings.pack},
                       {"measure", measure_seconds},     {"write", write_seconds}};
  report["counts"] = {{"vertices", scan.positions.size()}, {"triangles", scan.triangles.size()}};
  report["bytes"] = {{"hierarchy", bytes.hierarchy}, {"atlas", bytes.atlas}};
  for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
    const Level& level = rbvh.levels[i];
    report["levels"].push_back({{"name", level.name},
                                {"leaves", level.leaves.size()},
                                {"exact_leaves", level.exact_leaves.size()},
                                {"texels", std::uint64_t{level.atlas_width} * level.atlas_height},
                                {"texels_used", level.texels_used},
                                {"seconds", timings.levels[i].seconds}});
  }
  note(context, "rbvh build: wrote " + context.output + " (" + std::to_string(rbvh.levels.size()) +
                    " levels, " + format_bytes(bytes.hierarchy + bytes.atlas) + " with its atlas)");
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
  add_parsed(*stage, "--hybrid", options->hybrid, parse_hybrid, "WHEN",
             "which leaves keep their triangles or discs: off (none), auto (where tiles are faulty or more "
             "bytes, default), always");
  stage->add_flag(
      "--measure", options->measure,
      "compare each level with the scan in 8 views and store what is found (see validate --against)");
}

}  // namespace rbvh
