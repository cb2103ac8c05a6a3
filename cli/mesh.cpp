// rbvh mesh: a level of a pair as triangles or points, for programs that know no pairs.
#include "rbvh/mesh.h"

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/stages.h"
#include "io/output_file.h"
#include "io/report_json.h"
#include "io/report_text.h"
#include "io/scan_io.h"

namespace rbvh {
namespace {

struct MeshOptions {
  std::string file;
  std::vector<std::string> level;
};

void run_mesh(Context& context, const MeshOptions& options) {
  check_scan_output(context.output);
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
  for (const std::string& line : write_scan(context.output, mesh, context.force)) warn(context, line);
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
