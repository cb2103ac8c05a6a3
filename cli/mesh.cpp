// rbvh mesh: a level of a pair as triangles or points, for programs that know no pairs.
#include "rbvh/mesh.h"

#include <spdlog/fmt/fmt.h>

#include <filesystem>
#include <memory>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/stages.h"
#include "io/output_file.h"
#include "rbvh/io.h"

namespace rbvh {
namespace {

struct MeshOptions {
  std::string file;
  std::vector<std::string> level;
};

/// PLY, unless the name says GLB.
bool is_glb(const std::string& output) {
  const std::string extension = std::filesystem::path(output).extension().string();
  if (extension != ".glb" && extension != ".ply" && !extension.empty() && output != "-")
    throw Error(ErrorKind::kUsage, output, "mesh writes PLY and GLB; name the output .ply or .glb");
  return extension == ".glb";
}

nlohmann::ordered_json counts_json(const Scan& mesh, const LevelMeshCounts& counts) {
  nlohmann::ordered_json json = {{"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}};
  if (mesh.is_cloud()) return json;
  json["tile_quads"] = counts.tile_quads;
  json["trimmed_quads"] = counts.trimmed_quads;
  json["primitive_triangles"] = counts.primitive_triangles;
  json["welded_vertices"] = counts.welded_vertices;
  json["stitch_triangles"] = counts.stitch_triangles;
  json["primitive_open_edges"] = counts.primitive_open_edges;
  json["open_edges"] = counts.open_edges;
  json["non_manifold_edges"] = counts.non_manifold_edges;
  return json;
}

void run_mesh(Context& context, const MeshOptions& options) {
  const bool glb = is_glb(context.output);
  check_paths_differ(context, {options.file}, {context.output});
  check_output(context.output, context.force);
  check_is_pair(options.file);
  Stopwatch watch;
  const Asset pair = load(context, options.file);
  const double load_seconds = watch.lap();
  const std::string level = options.level.empty() ? level_names(pair).front() : options.level.front();
  LevelMeshCounts counts;
  context.progress.update("mesh", 0);
  const Scan mesh = level_mesh(pair, level, &counts);
  const double mesh_seconds = watch.lap();
  glb ? write_glb(context.output, mesh, pair.up_axis(), context.force)
      : write_ply(context.output, mesh, context.force);
  context.progress.finish();
  context.report["level"] = level;
  context.report["counts"] = counts_json(mesh, counts);
  context.report["timings"] = {{"load", load_seconds}, {"mesh", mesh_seconds}, {"write", watch.lap()}};
  if (mesh.is_cloud()) {
    note(context,
         fmt::format("rbvh mesh: wrote {} ({}, {} points)", context.output, level, mesh.positions.size()));
    return;
  }
  if (counts.tile_quads > 0)
    note(context,
         fmt::format("tiles: {} quads, {} of them trimmed; gaps: {} vertices welded, {} triangles added",
                     counts.tile_quads, counts.trimmed_quads, counts.welded_vertices,
                     counts.stitch_triangles));
  note(context,
       fmt::format("rbvh mesh: wrote {} ({}, {} vertices, {} triangles; {} open edges, {} non-manifold)",
                   context.output, level, mesh.positions.size(), mesh.triangles.size(), counts.open_edges,
                   counts.non_manifold_edges));
}

}  // namespace

void add_mesh(CLI::App& app, Context& context) {
  const auto options = std::make_shared<MeshOptions>();
  CLI::App* stage =
      add_stage(app, context,
                {"mesh", "Write a level as triangles or points (PLY, GLB)",
                 "rbvh mesh dragon.rbvh --level Q2 -o dragon.glb"},
                kWithOutput | kWithReport, [&context, options] { run_mesh(context, *options); });
  stage->add_option("PAIR", options->file, "an .rbvh pair")->required();
  add_level_option(*stage, options->level, false);
}

}  // namespace rbvh
