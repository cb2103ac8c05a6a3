// rbvh mesh: a level of a pair as triangles or points, for programs that know no pairs.
#include "rbvh/mesh.h"

#include <filesystem>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/stages.h"
#include "io/output_file.h"
#include "io/report_json.h"
#include "io/report_text.h"
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

void run_mesh(Context& context, const MeshOptions& options) {
  const bool glb = is_glb(context.output);
  check_paths_differ(context, {options.file}, {context.output});
  check_output(context.output, context.force);
  check_is_pair(options.file);
  const Asset pair = load(context, options.file);
  time_phase(context, "load");
  const std::string level = options.level.empty() ? level_names(pair).front() : options.level.front();
  LevelMeshCounts counts;
  context.progress.update("mesh", 0);
  const Scan mesh = level_mesh(pair, level, &counts);
  time_phase(context, "mesh");
  glb ? write_glb(context.output, mesh, pair.up_axis(), context.force)
      : write_ply(context.output, mesh, context.force);
  context.progress.finish();
  time_phase(context, "write");
  context.report["level"] = level;
  context.report["counts"] = mesh_json(mesh, counts);
  if (const std::string joined = joined_tiles_text(counts); !joined.empty()) note(context, joined);
  note(context, "rbvh mesh: wrote " + context.output + " (" + level + ", " + mesh_text(mesh, counts) + ")");
}

}  // namespace

void add_mesh(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(app, context,
                                          {"mesh", "Write a level as triangles or points (PLY, GLB)",
                                           "rbvh mesh dragon.rbvh --level Q2 -o dragon.glb"},
                                          kWithOutput | kWithReport, run_mesh);
  stage->add_option("PAIR", options->file, "an .rbvh pair")->required();
  add_level_option(*stage, options->level, false);
}

}  // namespace rbvh
