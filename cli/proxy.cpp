// rbvh proxy: from a mesh to quads with a vector displacement map.
#include <optional>

#include "cli/common.h"
#include "cli/stages.h"
#include "io/input_file.h"
#include "io/load_source.h"
#include "io/proxy_file.h"
#include "io/report_json.h"
#include "io/report_text.h"
#include "io/vdm_image.h"
#include "pipeline/measure/measure_json.h"
#include "pipeline/proxy/bake.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/proxy_words.h"

namespace rbvh {
namespace {

struct ProxyOptions {
  std::string file;
  std::string map;  // empty: none, so a mesh is baked
  VdmWords vdm;
  std::optional<std::uint32_t> max_side;
  std::optional<int> patches;
  BakeConfig bake;                           // but for the above
  std::vector<const CLI::Option*> of_bakes;  // options that imports have no use for
};

void run_bake(Context& context, const ProxyOptions& options) {
  BakeConfig config = options.bake;
  if (options.max_side) config.max_side = *options.max_side;
  if (config.max_error > 0) config.max_patches = 0;
  if (options.patches) config.max_patches = static_cast<std::uint64_t>(*options.patches);
  const SourceScan input = load_source(options.file, context.memory);
  check_bakeable(input.scan, options.file);
  check_budget(context.memory, bake_memory(input.scan), options.file, "baking it");
  time_phase(context, "load");
  BakeReport counts;
  const Proxy proxy = bake_proxy(input.scan, options.file, config, counts, context.progress.callback());
  time_phase(context, "bake");
  const ProxyHeader saved =
      save_proxy(context.output, proxy, {input.name, input.hash, input.scan.shift}, context.force);
  time_phase(context, "write");
  const nlohmann::ordered_json distance = proxy_measure_json(measure_proxy(proxy, input.scan));
  time_phase(context, "measure");

  auto& report = context.report;
  report["timings"].update(timings_json(counts));
  report.update(bake_json(counts));
  report["distance"] = distance;
  report["bytes"] = proxy_bytes_json(saved);
  for (const std::string& line : manifold_lines(counts.mesh)) note(context, line);
  note(context,
       "rbvh proxy: wrote " + context.output + " (" + bake_text(counts, saved.bytes(), distance) + ")");
}

void run_import(Context& context, const ProxyOptions& options) {
  for (const CLI::Option* option : options.of_bakes)
    if (option->count() > 0)
      throw Error(ErrorKind::kUsage, "",
                  "--patches, --max-error, --detail and --min-component are for baking a scan, and --vdm "
                  "brings a map");
  ImportConfig config;
  config.convention = vdm_convention(options.vdm);
  if (options.max_side) config.max_side = *options.max_side;
  const SourcePolygons source = load_polygon_source(options.file, context.memory);
  const VdmMap map = read_vdm_map(options.map);
  time_phase(context, "load");
  ImportReport counts;
  const Proxy proxy = import_vdm(source.mesh, map, config, input_name(options.file), counts);
  time_phase(context, "import");
  const ProxyHeader saved =
      save_proxy(context.output, proxy, {source.name, source.hash, counts.shift}, context.force);
  auto& report = context.report;
  time_phase(context, "write");
  report.update(import_json(counts));
  report["bytes"] = proxy_bytes_json(saved);
  for (const std::string& line : import_warnings(counts)) warn(context, options.file + ": " + line);
  note(context, "rbvh proxy: wrote " + context.output + " (" + import_text(counts, saved.bytes()) + ")");
}

void run_proxy(Context& context, const ProxyOptions& options) {
  if (options.map.empty() && options.vdm.any())
    throw Error(ErrorKind::kUsage, "", "--vdm-... say how to read a map; name it by --vdm MAP");
  check_paths_differ(context, {options.file, options.map},
                     {context.output, proxy_map_path(context.output), proxy_sidecar_path(context.output)});
  check_proxy_output(context.output, context.force);
  options.map.empty() ? run_bake(context, options) : run_import(context, options);
}

}  // namespace

void add_proxy(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"proxy", "Make a proxy of a mesh: quads and a vector displacement map",
                 "rbvh proxy dragon.ply -o dragon.obj --patches 3000"},
                kWithOutput | kWithReport, run_proxy);
  stage
      ->add_option("FILE", options->file,
                   "a mesh of any ingest format; with --vdm an OBJ (-: standard input)")
      ->required();
  const auto of_bakes = [&stage = *stage, &options = *options](const char* name, auto& target, auto parse,
                                                               const char* value, const char* help) {
    options.of_bakes.push_back(add_parsed(stage, name, target, parse, value, help));
  };
  of_bakes("--patches", options->patches, parse_positive, "N",
           "at most this many patches (default: 3000, or with --max-error as few as it allows)");
  of_bakes("--max-error", options->bake.max_error, parse_percent, "PERCENT",
           "how far the base quads' corners may simplify the surface, RMS in % of the diagonal");
  of_bakes("--detail", options->bake.detail, parse_percent, "PERCENT",
           "texels are fine enough that twice as many would change the surface by no more than this, RMS in "
           "% of the diagonal (default: 0.006)");
  of_bakes("--min-component", options->bake.min_component, parse_percent_or_none, "PERCENT",
           "leave out parts with less than this share of the area (default: 0.1; 0: keep all)");
  add_parsed(*stage, "--max-side", options->max_side, parse_tile_side, "N",
             "texels a side of a patch's tile at most, 2^k + 1 (default: 129; with --vdm 257)");
  stage
      ->add_option(
          "--vdm", options->map,
          "FILE is another program's base mesh (OBJ), and this its displacement map (EXR, PNG, TIFF): three "
          "channels are vectors, one is heights along the normal")
      ->type_name("MAP");
  add_parsed(*stage, "--vdm-space", options->vdm.space, parse_choice<kVdmSpaces>, "SPACE",
             "of the map's vectors: object, world or tangent (default: object; with --vdm-preset tangent)");
  add_parsed(
      *stage, "--vdm-order", options->vdm.order, parse_vdm_order, "XYZ",
      "what R, G and B hold: x, y, z, or t, b, n in tangent space, with - where turned round (default: xyz)");
  add_parsed(*stage, "--vdm-scale", options->vdm.scale, parse_displacement, "S",
             "what the map's values are multiplied by (default: 1)");
  add_parsed(*stage, "--vdm-midlevel", options->vdm.midlevel, parse_displacement, "M",
             "the map's value for no displacement (default: 0)");
  stage->add_option("--vdm-preset", options->vdm.preset, "order and midlevel as this program documents them")
      ->type_name("blender|mudbox|arnold|vray|moonray");
}

}  // namespace rbvh
