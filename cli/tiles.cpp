// rbvh tiles: a pair as a tileset for web viewers.
#include "rbvh/tileset.h"

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/stages.h"
#include "io/report_text.h"

namespace rbvh {
namespace {

struct TilesOptions {
  std::string file;
  std::vector<std::string> levels;
};

void run_tiles(Context& context, const TilesOptions& options) {
  check_paths_differ(context, {options.file}, {context.output});
  check_is_pair(options.file);
  LoadConfig config;
  if (!options.levels.empty()) config.levels = options.levels;
  const Asset pair = load(context, options.file, config);
  time_phase(context, "load");
  const TilesetCounts counts =
      write_tileset(context.output, pair, context.force, context.progress.callback());
  time_phase(context, "write");
  context.report["counts"] = {{"tiles", counts.tiles}};
  context.report["bytes"] = counts.bytes;
  note(context, "rbvh tiles: wrote " + context.output + " (" + counted(counts.tiles, "tile") + ", " +
                    format_bytes(counts.bytes) + ")");
}

}  // namespace

void add_tiles(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(
      app, context,
      {"tiles", "Write a pair as a 3D Tiles tileset, for web viewers", "rbvh tiles dragon.rbvh -o tiles"},
      kWithOutput | kWithReport, run_tiles);
  stage->add_option("PAIR", options->file, "an .rbvh pair")->required();
  add_level_option(*stage, options->levels, true);
}

}  // namespace rbvh
