// rbvh ingest: any scan in, one clean binary PLY out.
#include "pipeline/scan/ingest.h"

#include <filesystem>
#include <memory>

#include "cli/common.h"
#include "cli/stages.h"
#include "io/output_file.h"
#include "io/proxy_file.h"
#include "io/scan_io.h"

namespace rbvh {
namespace {

struct IngestOptions {
  std::vector<std::string> inputs;
  IngestConfig config;
  std::vector<const CLI::Option*> of_clouds;  // that meshes have no use for, beside what ingest() refuses
};

Outliers parse_outliers(std::string_view text) {
  const std::vector<std::string> words = parse_list(text);
  if (words.size() != 2) throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not K,SIGMA");
  Outliers outliers{.neighbors = static_cast<std::size_t>(parse_positive(words[0])),
                    .sigma = parse_number(words[1])};
  if (outliers.sigma <= 0) throw Error(ErrorKind::kUsage, "", "SIGMA must be above 0");
  return outliers;
}

double parse_size(std::string_view text) {
  const double size = parse_number(text);
  if (size <= 0) throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not above 0");
  return size;
}

double parse_fraction(std::string_view text) {
  const double fraction = parse_number(text);
  if (fraction < 0 || fraction > 1)
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not between 0 and 1");
  return fraction;
}

std::size_t parse_neighbors(std::string_view text) {
  const int count = parse_positive(text);
  if (count < 3 || count > 1000)
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not 3 to 1000");
  return static_cast<std::size_t>(count);
}

// Most bytes held at once, as measured: while a mesh is cleaned, while a cloud has all its neighbours.
constexpr std::uint64_t kBytesPerVertex = 64, kBytesPerFace = 32, kBytesPerPoint = 600;

void check_memory(const Context& context, const RawScan& scan, const std::string& input) {
  const std::uint64_t vertices = scan.positions.size();
  check_budget(context.memory,
               scan.triangles.empty() ? vertices * kBytesPerPoint
                                      : vertices * kBytesPerVertex + scan.triangles.size() * kBytesPerFace,
               input, "cleaning it");
}

RawScan read_all(Context& context, const std::vector<std::string>& inputs) {
  RawScan all;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    context.progress.update("read", static_cast<double>(i) / static_cast<double>(inputs.size()));
    check_read_budget(context.memory, inputs[i], 1);
    refuse_proxy(inputs[i]);
    RawScan scan = read_scan(inputs[i]);
    for (const std::string& text : scan.notes) warn(context, inputs[i] + ": " + text);
    try {
      merge_scan(all, std::move(scan));
    } catch (const Error& error) {
      throw Error(error.kind(), inputs[i], error.what(), error.remedy());
    }
    check_memory(context, all, inputs[i]);
  }
  return all;
}

nlohmann::ordered_json report_json(const IngestReport& counts, const Scan& scan,
                                   const std::vector<std::string>& inputs) {
  const CleanCounts& gone = counts.cleaned;
  const Bounds3f box = bounds(scan);
  return {
      {"inputs", inputs},
      {"kind", scan.is_cloud() ? "cloud" : "mesh"},
      {"vertices_in", counts.vertices_in},
      {"faces_in", counts.faces_in},
      {"vertices_out", counts.vertices_out},
      {"faces_out", counts.faces_out},
      {"objects", counts.objects},
      {"removed",
       {{"non_finite_vertices", gone.non_finite_vertices},
        {"non_finite_faces", gone.non_finite_faces},
        {"duplicate_vertices", gone.duplicate_vertices},
        {"duplicate_faces", gone.duplicate_faces},
        {"zero_area_faces", gone.zero_area_faces},
        {"unreferenced_vertices", gone.unreferenced_vertices},
        {"outliers", counts.outliers},
        {"thinned", counts.thinned},
        {"small_components", counts.small_components.components},
        {"small_component_vertices", counts.small_components.vertices},
        {"small_component_faces", counts.small_components.faces}}},
      {"added",
       {{"normals_estimated", counts.cloud.normals_estimated},
        {"normals_by_viewpoint", counts.cloud.normals_by_viewpoint},
        {"mesh_normals_completed", counts.mesh_normals_completed},
        {"radii_estimated", counts.cloud.radii_estimated}}},
      {"shift", {scan.shift.x, scan.shift.y, scan.shift.z}},
      {"bounds", {{"low", {box.lo.x, box.lo.y, box.lo.z}}, {"high", {box.hi.x, box.hi.y, box.hi.z}}}},
      {"area", counts.area},
  };
}

/// "3 duplicate faces, 1 ..."; the ones that are not zero.
std::string list_counts(const std::vector<std::pair<std::size_t, const char*>>& counts) {
  std::string text;
  for (const auto& [count, noun] : counts)
    if (count > 0) text += (text.empty() ? "" : ", ") + counted(count, noun);
  return text;
}

void note_figures(Context& context, const IngestReport& counts, const Scan& scan) {
  const CleanCounts& gone = counts.cleaned;
  std::string made =
      scan.is_cloud() ? counted(counts.vertices_out, "point")
                      : counted(counts.faces_out, "triangle") + ", " + counted(counts.vertices_out, "vertex");
  if (counts.objects > 1) made += ", " + counted(counts.objects, "object");
  note(context, context.output + ": " + made);
  const std::string removed = list_counts({{gone.non_finite_vertices, "non-finite vertex"},
                                           {gone.non_finite_faces, "non-finite face"},
                                           {gone.duplicate_vertices, "duplicate vertex"},
                                           {gone.duplicate_faces, "duplicate face"},
                                           {gone.zero_area_faces, "zero-area face"},
                                           {gone.unreferenced_vertices, "unreferenced vertex"},
                                           {counts.outliers, "outlier"},
                                           {counts.thinned, "thinned point"},
                                           {counts.small_components.components, "small component"}});
  if (!removed.empty()) note(context, "removed: " + removed);
  const std::string added = list_counts({{counts.cloud.normals_estimated, "normal"},
                                         {counts.cloud.normals_by_viewpoint, "viewpoint-facing normal"},
                                         {counts.mesh_normals_completed, "vertex normal"},
                                         {counts.cloud.radii_estimated, "radius"}});
  if (!added.empty()) note(context, "estimated: " + added);
  if (scan.shift != Vec3d{}) {
    const nlohmann::json shift = {scan.shift.x, scan.shift.y, scan.shift.z};
    note(context, "shifted: original coordinates are these plus " + shift.dump());
  }
}

void check_extension(const std::string& output) {
  const std::string extension = std::filesystem::path(output).extension().string();
  for (const char* other : {".obj", ".stl", ".off", ".pcd", ".xyz", ".csv", ".txt", ".las", ".rbvh"})
    if (extension == other) throw Error(ErrorKind::kUsage, output, "ingest writes PLY; name the output .ply");
}

void run_ingest(Context& context, const IngestOptions& options) {
  check_extension(context.output);
  check_output(context.output, context.force);
  Stopwatch watch;
  RawScan all = read_all(context, options.inputs);
  if (!all.triangles.empty())
    refuse_options(options.of_clouds, options.inputs[0], "is for clouds, and this is a mesh");
  const double read_seconds = watch.lap();
  const std::string name = options.inputs.size() == 1 ? options.inputs[0] : "the inputs";
  IngestReport counts;
  const Scan scan = ingest(std::move(all), name, options.config, counts, context.progress.callback());
  const double clean_seconds = watch.lap();
  context.progress.update("write", 0);
  write_ply(context.output, scan, context.force);
  context.progress.finish();
  context.report.update(report_json(counts, scan, options.inputs));
  context.report["timings"] = {{"read", read_seconds}, {"clean", clean_seconds}, {"write", watch.lap()}};
  note_figures(context, counts, scan);
}

}  // namespace

void add_ingest(CLI::App& app, Context& context) {
  const auto options = std::make_shared<IngestOptions>();
  IngestConfig& config = options->config;
  CLI::App* stage =
      add_stage(app, context,
                {"ingest", "Read, merge and clean scans (PLY OBJ STL OFF PCD XYZ) into one PLY",
                 "rbvh ingest scan1.pcd scan2.pcd -o scan.ply"},
                kWithOutput | kWithReport, [&context, options] { run_ingest(context, *options); });
  stage->add_option("IN", options->inputs, "scans; each becomes an object id; '-' is standard input")
      ->required();
  add_parsed(*stage, "--outliers", config.outliers, parse_outliers, "K,SIGMA",
             "remove points whose mean distance to their K nearest is over SIGMA deviations above the mean "
             "(default: none)");
  add_parsed(*stage, "--voxel", config.voxel, parse_size, "SIZE",
             "thin a cloud to one point a cube of this side, in scan units (default: off)");
  add_parsed(*stage, "--min-component", config.min_component, parse_fraction, "FRACTION",
             "remove connected parts with less than this fraction of all faces or points (default: 0)");
  options->of_clouds.push_back(
      add_parsed(*stage, "--normals-k", config.normals_k, parse_neighbors, "K",
                 "neighbours from which a cloud's normals and radii are estimated (default: 16)"));
  add_parsed(*stage, "--viewpoint", config.viewpoint, parse_vec3, "X,Y,Z",
             "where the scanner stood, in the input's coordinates (default: the file's, else none)");
  stage->add_flag("--recompute-normals", config.recompute_normals,
                  "estimate a cloud's normals even where the file has them");
  stage->add_flag("--flip-normals", config.flip_normals, "turn all normals and faces to the other side");
}

}  // namespace rbvh
