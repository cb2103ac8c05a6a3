// rbvh build: from an ingested scan to an .rbvh pair.
#include "chunks/build_in_chunks.h"
#include "chunks/chunk_report.h"
#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/layer_options.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "cli/views_options.h"
#include "io/input_file.h"
#include "io/load_source.h"
#include "io/rbvh_file.h"
#include "io/report_json.h"
#include "io/report_text.h"
#include "pipeline/base/error_bound.h"
#include "pipeline/device/open_meanwhile.h"
#include "pipeline/measure/stored_fidelity.h"
#include "pipeline/rbvh/build_options.h"
#include "pipeline/rbvh/layers.h"

namespace rbvh {
namespace {

enum class LevelsBy { kError, kDensity };
constexpr std::pair<std::string_view, LevelsBy> kLevelsBy[] = {{"error", LevelsBy::kError},
                                                               {"density", LevelsBy::kDensity}};

struct BuildOptions {
  std::vector<std::string> files;
  std::string file;  // these, as messages name them
  BuildConfig config;
  std::vector<WantedLevel> levels;  // empty: all
  std::optional<ErrorBound> error;  // of the one level
  LevelsBy levels_by = LevelsBy::kError;
  std::optional<Vec3d> focus, focus_camera;
  std::optional<double> focus_radius;
  std::optional<std::string> focus_level;  // Q0
  LayerWords layers;                       // of the scan's vertex properties
  bool measure = false, shifted = false;
  ViewsConfig views;
  std::uint32_t chunks = 0;  // 0: as memory asks for
  bool resume = false;
};

std::uint32_t parse_chunks(std::string_view text) {
  return static_cast<std::uint32_t>(parse_integer_between(text, 1, 256));
}

std::optional<FocusWords> focus_words(const BuildOptions& options) {
  const auto refuse = [](const char* what) { throw Error(ErrorKind::kUsage, "", what); };
  if (options.focus && options.focus_camera) refuse("--focus and --focus-camera: one of them is wanted");
  if (options.focus && !options.focus_radius) refuse("--focus: how far around it? Add --focus-radius");
  const bool is_given = options.focus || options.focus_camera;
  if ((options.focus_radius || options.focus_level) && !is_given)
    refuse("--focus-radius and --focus-level: around what? Add --focus or --focus-camera");
  if (!is_given) return {};
  return FocusWords{.point = options.focus ? *options.focus : *options.focus_camera,
                    .is_camera = options.focus_camera.has_value(),
                    .radius = options.focus_radius,
                    .level = standard_levels({options.focus_level.value_or("Q0")}).front()};
}

/// Those of --levels and --levels-by; --error's needs the scan.
std::vector<LevelConfig> named_levels(const BuildOptions& options) {
  const auto refuse = [](const char* what) { throw Error(ErrorKind::kUsage, "", what); };
  if (options.error && !options.levels.empty())
    refuse("--error and --levels: one of them is wanted (--levels Q0=1e-5,Q2 states errors of several)");
  std::vector<LevelConfig> levels = wanted_levels(options.levels);
  if (options.levels_by == LevelsBy::kError) return levels;
  if (options.error) refuse("--error: levels by density have no error; leave out --levels-by");
  for (const WantedLevel& level : options.levels)
    if (level.error) refuse("--levels: levels by density have no error; name them alone");
  return by_density(std::move(levels));
}

/// Names the file in errors of work that does not know where the scan came from.
template <class Work>
auto with_file(const std::string& file, Work&& work) {
  try {
    return work();
  } catch (const Error& error) {
    if (!error.file().empty()) throw;
    throw Error(error.kind(), input_name(file), error.what(), error.remedy());
  }
}

/// Levels that missed their errors; and a pair that is larger than its scan is rarely what was wanted.
template <class Levels>
void say_shortcomings(Context& context, const std::string& file, const Levels& levels,
                      std::uint64_t pair_bytes, std::uint64_t scan_bytes) {
  if (const std::string missed = missed_errors(levels); !missed.empty())
    note(context,
         "rbvh build: farther from the scan than asked for, rms of sampled points over the diagonal: " +
             missed);
  if (pair_bytes > scan_bytes)
    note(context, "rbvh build: " + context.output + " is " +
                      larger_than_text(pair_bytes, scan_bytes, input_name(file)) + "; build " +
                      (levels.size() > 1 ? "fewer or coarser levels" : "a coarser level") +
                      " (--levels Q4, or --error)");
}

/// Scans that are larger than memory.
void run_in_chunks(Context& context, const BuildOptions& options, BuildConfig config) {
  if (options.focus || options.focus_camera || options.measure || !options.layers.names.empty())
    throw Error(ErrorKind::kUsage, options.file,
                "is built in chunks, which have no --focus, --layer or --measure; give it more --memory, or "
                "leave these out");
  const ChunkConfig chunks{.memory = context.memory,
                           .chunks = options.chunks,
                           .resume = options.resume,
                           .overwrite = context.force};
  check_chunk_output(context.output, context.force);
  std::future<Device> opening = open_meanwhile(context.device);
  const ChunkSource source =
      open_chunk_source(options.files, context.output, chunks, context.progress.callback());
  for (const std::string& line : source.notes) note(context, "rbvh build: " + line);
  const BigPly& ply = source.ply;
  const ScanSurvey survey = survey_scan(ply, context.progress.callback());
  const ErrorScale scale{static_cast<double>(survey.box.diagonal()), ply.header.units};
  if (options.error)
    config.levels = {level_of_error(part_of_diagonal(*options.error, "units", scale, ply.path))};
  time_phase(context, "survey");
  const Device device = opening.get();
  report_device(context, device);
  const ChunkReport done = with_file(options.file, [&] {
    return build_in_chunks(device, survey, context.output, config, chunks, context.progress.callback());
  });
  time_phase(context, "build");
  context.report.update(chunks_json(done));
  note(context, "rbvh build: wrote " + context.output + " (" + counted(done.levels.size(), "level") + " in " +
                    counted(done.chunks, "part") + ", " + format_bytes(done.bytes) +
                    (done.resumed > 0 ? ", " + counted(done.resumed, "part") + " found built)" : ")"));
  say_shortcomings(context, options.file, done.levels, done.bytes, done.scan_bytes);
}

void run_build(Context& context, const BuildOptions& given) {
  BuildOptions options = given;
  options.file = joined_name(options.files);
  const std::optional<FocusWords> focus = focus_words(options);
  BuildConfig config = options.config;
  config.levels = named_levels(options);
  if (options.files.size() > 1 && context.output.find('{') != std::string::npos)
    throw Error(ErrorKind::kUsage, context.output,
                "several scans become one pair, of one name; rbvh batch builds a pair of each");
  check_paths_differ(context, options.files, {context.output, atlas_path(context.output)});
  check_pair_output(context);
  if (options.chunks > 0 || !fits_memory(options.files, config, context.memory))
    return run_in_chunks(context, options, config);
  std::future<Device> opening = open_meanwhile(context.device);

  std::vector<std::string> notes;
  SourceScan source = load_sources(options.files, context.memory, notes);
  for (const std::string& line : notes) note(context, "rbvh build: " + line);
  Scan& scan = source.scan;
  for (const std::string& fault : scan.texture_faults) warn(context, options.file + ": " + fault);
  check_buildable(scan, options.file);
  if (options.config.color_scale && scan.textures.empty())
    throw Error(ErrorKind::kUsage, options.file, "--color-scale: it has no textures");
  const ErrorScale scale{static_cast<double>(bounds(scan).diagonal()), scan.units};
  if (options.error)
    config.levels = {
        level_of_error(part_of_diagonal(*options.error, "units", scale, input_name(options.file)))};
  check_budget(context.memory, build_memory(scan, config), options.file, "building it");
  if (focus) {
    FocusWords placed = *focus;
    if (!options.shifted) placed.point = placed.point - scan.shift;
    config.focus = place_focus(placed, scan);
  }
  time_phase(context, "load");

  const Device device = opening.get();
  report_device(context, device);
  BuildTimings timings;
  context.phase_watch.lap();
  Rbvh rbvh = with_file(
      options.file, [&] { return build_rbvh(device, scan, config, context.progress.callback(), &timings); });
  time_phase(context, "build");
  rbvh.source.name = source.name;
  rbvh.source.hash = source.hash;
  for (const std::string& name : options.layers.names) warn_of_infinite(context, options.file, scan, name);
  with_file(options.file, [&] {
    add_property_layers(rbvh.levels, scan, options.layers.names, options.layers.scale,
                        context.progress.callback());
  });
  time_phase(context, "layers");
  if (options.measure)
    measure_and_store(device, rbvh, scan, options.views, context.memory, context.progress.callback());
  time_phase(context, "measure");
  rbvh.build_options = build_options_json(config, focus, options.layers);
  const RbvhBytes bytes = write_pair(context, context.output, rbvh, counted(rbvh.levels.size(), "level"));

  auto& report = context.report;
  report["timings"].update(timings_json(timings));
  report["counts"] = {{"vertices", scan.positions.size()}, {"triangles", scan.triangles.size()}};
  report["levels"] = levels_json(rbvh, timings);
  const std::uint64_t pair_bytes = bytes.hierarchy + bytes.atlas;
  report["bytes"]["scan"] = source.bytes;
  report["bytes"]["pair_to_scan"] = static_cast<double>(pair_bytes) / static_cast<double>(source.bytes);
  say_shortcomings(context, options.file, rbvh.levels, pair_bytes, source.bytes);
}

}  // namespace

void add_build(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"build", "Make an .rbvh pair of an ingested scan", "rbvh build dragon.ply -o dragon.rbvh"},
                kWithOutput | kWithDevice | kWithReport, run_build);
  BuildConfig& config = options->config;
  stage
      ->add_option("FILE", options->files,
                   "the scan, as ingest writes it (-: standard input); several are merged and cleaned as by "
                   "ingest, each an object of its own")
      ->required();
  add_parsed(*stage, "--levels", options->levels, parse_wanted_levels, "Q0=1e-5,Q2",
             "which levels (default: all five), each with its own error or with one that you give: rms, as a "
             "part of the diagonal, 1e-6 to 0.1");
  add_parsed(*stage, "--error", options->error, parse_error_bound, "0.5mm",
             "one level of this error: in mm, cm, m, km, in, ft (of a scan that states its units), % of the "
             "diagonal, or scan units (a number alone); it has the name of the standard level whose error is "
             "nearest");
  add_parsed(
      *stage, "--levels-by", options->levels_by, parse_choice<kLevelsBy>, "HOW",
      "what makes a level: its error (tiles, or simplified triangles where these are better, default) or "
      "density (the paper's texels alone)");
  add_parsed(*stage, "--refinement", config.refinement, parse_choice<kRefinements>, "HOW",
             "what splits a node: area (projected area, default) or cone (cone of normals)");
  add_parsed(*stage, "--split", config.split, parse_choice<kSplitRules>, "HOW",
             "where a node is split: median (of the longest axis, default) or sah (surface area heuristic)");
  add_parsed(*stage, "--partition", config.partition, parse_choice<kPartitionPlaces>, "WHERE",
             "what splits the nodes: the device (default), or one core of the host in double precision");
  add_parsed(
      *stage, "--rays", config.rays, parse_choice<kRayKinds>, "KIND",
      "what tiles are sized for: coherent rays (default) or incoherent ones, which prefer smaller tiles");
  add_parsed(*stage, "--focus", options->focus, parse_vec3, "x,y,z",
             "a point of interest, in the scan's coordinates: every level is finer there");
  add_parsed(
      *stage, "--focus-radius", options->focus_radius, parse_above_zero, "R",
      "within it quality is the focus level's; beyond, texels grow with the distance up to the level's own");
  add_parsed(*stage, "--focus-level", options->focus_level, parse_name, "Q0",
             "the quality there (default: Q0)");
  add_parsed(*stage, "--focus-camera", options->focus_camera, parse_vec3, "x,y,z",
             "the same seen from a camera: what is nearest to it has the focus level's quality");
  add_coordinates_option(*stage, options->shifted);
  add_parsed(*stage, "--layer", options->layers.names, parse_names, "NAME,NAME",
             "make layers of these properties of the scan's vertices");
  add_parsed(*stage, "--layer-scale", options->layers.scale, parse_layer_scale, "S",
             "their texels to one of the heights', 0.0625 to 16 (default: 1)")
      ->needs("--layer");
  add_parsed(*stage, "--color-scale", config.color_scale, parse_layer_scale, "S",
             "texels of a textured scan's colours to one of the heights', 0.0625 to 16 (default: 2, or "
             "fewer, as its images have)");
  add_parsed(*stage, "--hybrid", config.hybrid, parse_choice<kHybrids>, "WHEN",
             "which leaves hold triangles or discs: off (none), auto (where tiles are faulty "
             "or take more bytes, default), always");
  stage->add_flag(
      "--measure", options->measure,
      "compare each level with the scan in 8 views and store what is found (see validate --against)");
  add_views_options(*stage, options->views, "--measure");
  add_parsed(*stage, "--chunks", options->chunks, parse_chunks, "N",
             "build N parts one after the other, and a table of them (default: as many as --memory asks for; "
             "what fits is built as a whole)");
  stage->add_flag("--resume", options->resume,
                  "of a build in chunks: go on from what a killed one of the same scan and options has left");
}

}  // namespace rbvh
