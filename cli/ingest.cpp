// rbvh ingest: any scan in, one clean binary PLY out (or a GLB).
#include "pipeline/scan/ingest.h"

#include "cli/common.h"
#include "cli/stages.h"
#include "io/output_file.h"
#include "io/report_json.h"
#include "io/report_text.h"
#include "io/scan_io.h"
#include "io/text_columns.h"
#include "pipeline/base/text.h"
#include "pipeline/base/units.h"
#include "pipeline/scan/ingest_words.h"
#include "pipeline/scan/keep_classes.h"

namespace rbvh {
namespace {

constexpr std::pair<std::string_view, bool> kWindings[] = {{"keep", false}, {"orient", true}};

struct IngestOptions {
  std::vector<std::string> inputs;
  std::string units;  // empty: as the inputs state them
  TextColumns columns;
  std::vector<std::uint8_t> classes;  // none: all
  IngestConfig config;
  std::vector<const CLI::Option*> of_clouds;  // that meshes have no use for, beside what ingest() refuses
};

double parse_fraction(std::string_view text) { return parse_between(text, 0, 1); }

std::size_t parse_neighbors(std::string_view text) {
  return static_cast<std::size_t>(parse_integer_between(text, 3, 1000));
}

std::string parse_units(std::string_view text) {
  if (!unit_meters(text))
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not " + std::string(kUnitNames));
  return std::string(text);
}

/// A scan's own units are not converted.
void state_units(RawScan& scan, const std::string& name, const std::string& units) {
  if (!units.empty() && !scan.units.empty() && units != scan.units)
    throw Error(ErrorKind::kUsage, name, "--units: it states that it is in " + scan.units);
  if (!units.empty()) scan.units = units;
}

RawScan read_inputs(Context& context, const IngestOptions& options) {
  const auto on_note = [&](const std::string& path, const std::string& text) {
    warn(context, path + ": " + text);
  };
  try {
    return read_scans(options.inputs, context.memory, on_note, context.progress.callback(), options.columns);
  } catch (const ColumnsUnknown& error) {
    throw Error(error.kind(), "", std::string(error.what()) + " (--columns x=1,y=2,z=3)");
  }
}

void run_ingest(Context& context, const IngestOptions& options) {
  check_scan_output(context.output);
  check_paths_differ(context, options.inputs, {context.output});
  check_output(context.output, context.force);
  RawScan all = read_inputs(context, options);
  if (!all.triangles.empty())
    refuse_options(options.of_clouds, options.inputs[0], "is for clouds, and this is a mesh");
  time_phase(context, "read");
  const std::string name = options.inputs.size() == 1 ? options.inputs[0] : "the inputs";
  state_units(all, name, options.units);
  const std::size_t others = options.classes.empty() ? 0 : keep_classes(all, options.classes, name);
  IngestReport counts;
  const Scan scan = ingest(std::move(all), name, options.config, counts, context.progress.callback());
  time_phase(context, "clean");
  context.progress.update("write", 0);
  for (const std::string& line : write_scan(context.output, scan, context.force)) warn(context, line);
  context.progress.finish();
  time_phase(context, "write");
  context.report.update(ingest_json(counts, scan, options.inputs));
  context.report["removed"]["other_classes"] = others;
  if (others > 0) note(context, "left out: " + counted(others, "point") + " of other classes");
  for (const std::string& line : ingest_lines(context.output, counts, scan)) note(context, line);
}

}  // namespace

void add_ingest(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"ingest",
                 "Read, merge and clean scans (PLY OBJ STL OFF PCD PTX LAS glTF XYZ) into one PLY, "
                 "with the images of textures beside it (or GLB, with them inside)",
                 "rbvh ingest scan1.pcd scan2.pcd -o scan.ply"},
                kWithOutput | kWithReport, run_ingest);
  IngestConfig& config = options->config;
  stage->add_option("IN", options->inputs, "scans; each becomes an object id; '-' is standard input")
      ->required();
  add_parsed(*stage, "--outliers", config.outliers, parse_outliers, "K,SIGMA",
             "remove points whose mean distance to their K nearest is over SIGMA deviations above the mean "
             "(default: none)");
  add_parsed(*stage, "--voxel", config.voxel, parse_above_zero, "SIZE",
             "thin a cloud to one point a cube of this side, in scan units (default: off)");
  options->of_clouds.push_back(add_parsed(
      *stage, "--class", options->classes, parse_classes, "2,6",
      "keep the points of these classes only: 2 is ground, 6 buildings (LAS and other clouds with a "
      "property 'classification'; default: all)"));
  add_parsed(*stage, "--min-component", config.min_component, parse_fraction, "FRACTION",
             "remove connected parts with less than this fraction of all faces or points (default: 0)");
  options->of_clouds.push_back(
      add_parsed(*stage, "--normals-k", config.normals_k, parse_neighbors, "K",
                 "neighbours from which a cloud's normals and radii are estimated (default: 16)"));
  add_parsed(*stage, "--viewpoint", config.viewpoint, parse_vec3, "X,Y,Z",
             "where the scanner stood, in the input's coordinates (default: the file's, else none)");
  add_parsed(*stage, "--columns", options->columns, parse_text_columns, "x=1,y=2,z=3",
             "which columns of a text cloud, from 1, are what: x, y, z, nx, ny, nz, red, green, blue, or a "
             "property's name (default: as its header says, else the first three)");
  add_parsed(*stage, "--units", options->units, parse_units, "mm",
             "what the coordinates are in: mm, cm, m, km, in or ft; it is noted, nothing is converted");
  stage->add_flag("--recompute-normals", config.recompute_normals,
                  "estimate a cloud's normals even where the file has them");
  stage->add_flag(
      "--remove-far", config.remove_far,
      "remove points 10000 times as far from the others as most of these are apart (0 0 0 in UTM)");
  add_parsed(*stage, "--winding", config.orient, parse_choice<kWindings>, "HOW",
             "of a mesh's faces: keep (default), or orient: turn those that disagree with their neighbours");
  stage->add_flag("--flip-normals", config.flip_normals, "turn all normals and faces to the other side");
}

}  // namespace rbvh
