// rbvh proxy: from a mesh to quads with a vector displacement map.
#include <spdlog/fmt/fmt.h>

#include <bit>
#include <filesystem>
#include <memory>
#include <optional>

#include "cli/common.h"
#include "cli/measure.h"
#include "cli/stages.h"
#include "io/hash.h"
#include "io/input_file.h"
#include "io/proxy_file.h"
#include "io/scan_io.h"
#include "pipeline/proxy/bake.h"
#include "pipeline/scan/ingest.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

// What a bake has in memory at its peak, beside the file, as measured.
constexpr std::uint64_t kBytesPerTriangle = 420;

struct ProxyOptions {
  std::string file;
  std::optional<int> patches;
  std::optional<double> max_error_percent;
  BakeConfig bake;
};

double parse_percent(std::string_view text) {
  const double percent = parse_number(text);
  if (!(percent > 0 && percent <= 100))
    throw Error(ExitCode::kUsage, "", "'" + std::string(text) + "' is not above 0 and up to 100 percent");
  return percent;
}

double parse_percent_as_fraction(std::string_view text) { return parse_percent(text) / 100; }

double parse_component(std::string_view text) {
  const double percent = parse_number(text);
  if (!(percent >= 0 && percent <= 100))
    throw Error(ExitCode::kUsage, "", "'" + std::string(text) + "' is not 0 to 100 percent");
  return percent / 100;
}

std::uint32_t parse_side(std::string_view text) {
  const std::int64_t side = parse_integer(text);
  if (side < 3 || side > 1025 || !std::has_single_bit(static_cast<std::uint64_t>(side - 1)))
    throw Error(ExitCode::kUsage, "", "'" + std::string(text) + "' is none of 3, 5, 9, 17, 33, 65 ... 1025");
  return static_cast<std::uint32_t>(side);
}

struct Input {
  Scan scan;
  ProxySource source;
};

Input read_mesh(Context& context, const ProxyOptions& options) {
  Input input;
  const InputBytes bytes = read_input(options.file);
  check_budget(context, bytes.size * 3, options.file, "reading it");
  input.source.name = options.file == "-" ? "stdin" : fs::path(options.file).filename().string();
  input.source.hash = hash_bytes(bytes.view());
  input.scan = shift_to_float(parse_scan(bytes.view(), options.file));
  input.source.shift = input.scan.shift;
  check_usable(input.scan, options.file);
  for (std::size_t i = 0; i < input.scan.positions.size(); ++i)
    if (!is_finite(input.scan.positions[i]))
      throw Error(ExitCode::kInput, options.file,
                  "vertex " + std::to_string(i) + " is not finite; run rbvh ingest on it first");
  check_budget(context, input.scan.triangles.size() * kBytesPerTriangle, options.file, "baking it");
  return input;
}

nlohmann::ordered_json counts_json(const BakeReport& counts) {
  return {{"triangles_in", counts.triangles_in},
          {"flat_triangles", counts.mesh.flat_triangles},
          {"small_components", counts.mesh.small_components},
          {"small_component_triangles", counts.mesh.small_triangles},
          {"cut_edges", counts.mesh.cut_edges},
          {"cut_vertices", counts.mesh.cut_vertices},
          {"open_edges", counts.mesh.open_edges},
          {"components", counts.mesh.components},
          {"base_triangles", counts.base_triangles},
          {"alone_triangles", counts.alone_triangles},
          {"folded_steps", counts.folded_steps},
          {"patches", counts.patches},
          {"patches_of_level", counts.patches_of_level},
          {"patches_at_limit", counts.patches_at_limit},
          {"texels", counts.texels},
          {"projected_texels", counts.projected_texels}};
}

void run_bake(Context& context, const ProxyOptions& options) {
  BakeConfig config = options.bake;
  if (options.max_error_percent) {
    config.max_error = *options.max_error_percent / 100;
    config.max_patches = 0;
  }
  if (options.patches) config.max_patches = static_cast<std::uint64_t>(*options.patches);
  check_paths_differ(context, {options.file},
                     {context.output, proxy_map_path(context.output), proxy_sidecar_path(context.output)});
  check_proxy_output(context.output, context.force);

  Stopwatch watch;
  const Input input = read_mesh(context, options);
  const double load_seconds = watch.lap();
  BakeReport counts;
  const Proxy proxy = bake_proxy(input.scan, options.file, config, counts, context.progress.callback());
  const double bake_seconds = watch.lap();
  const ProxyHeader header = save_proxy(context.output, proxy, input.source, context.force);
  const double write_seconds = watch.lap();
  const nlohmann::ordered_json distance = proxy_measure_json(measure_proxy(proxy, input.scan));
  const double measure_seconds = watch.lap();

  auto& report = context.report;
  report["timings"] = {{"load", load_seconds},        {"bake", bake_seconds},
                       {"join", counts.join_seconds}, {"decimate", counts.decimate_seconds},
                       {"pair", counts.pair_seconds}, {"sample", counts.sample_seconds},
                       {"write", write_seconds},      {"measure", measure_seconds}};
  report["counts"] = counts_json(counts);
  report["distortion"] = {{"stretch_median", counts.stretch_median},
                          {"stretch_p95", counts.stretch_p95},
                          {"area_p95", counts.area_p95}};
  report["longest_displacement"] = counts.longest_displacement;
  report["distance"] = distance;
  report["bytes"] = {
      {"mesh", header.mesh_bytes}, {"map", header.map_bytes}, {"sidecar", header.sidecar_bytes}};
  const ManifoldCounts& mesh = counts.mesh;
  if (mesh.small_components > 0)
    note(context, fmt::format("left out: {} small components ({} triangles)", mesh.small_components,
                              mesh.small_triangles));
  if (mesh.cut_edges > 0)
    note(context, fmt::format("{} edges are no surface's: more than two triangles meet there, or two that "
                              "turn opposite ways; cut",
                              mesh.cut_edges));
  note(context,
       fmt::format(
           "rbvh proxy: wrote {} ({} patches, {} texels, {}; RMS distance {:.2g}% to the scan, {:.2g}% "
           "back)",
           context.output, counts.patches, counts.texels, format_bytes(header.bytes()),
           distance["proxy_to_scan"]["rms_percent"].get<double>(),
           distance["scan_to_proxy"]["rms_percent"].get<double>()));
}

}  // namespace

void add_proxy(CLI::App& app, Context& context) {
  const auto options = std::make_shared<ProxyOptions>();
  CLI::App* stage =
      add_stage(app, context,
                {"proxy", "Make a proxy of a mesh: quads and a vector displacement map",
                 "rbvh proxy dragon.ply -o dragon.obj --patches 3000"},
                kWithOutput | kWithReport, [&context, options] { run_bake(context, *options); });
  stage->add_option("FILE", options->file, "a mesh of any ingest format (-: standard input)")->required();
  add_parsed(*stage, "--patches", options->patches, parse_positive, "N",
             "at most this many patches (default: 3000, or with --max-error as few as it allows)");
  add_parsed(*stage, "--max-error", options->max_error_percent, parse_percent, "PERCENT",
             "how far the base quads' corners may simplify the surface, RMS in % of the diagonal");
  add_parsed(
      *stage, "--detail", options->bake.detail, parse_percent_as_fraction, "PERCENT",
      "texels are fine enough that twice as many would change the surface by no more than this, RMS in "
      "% of the diagonal (default: 0.006)");
  add_parsed(*stage, "--max-side", options->bake.max_side, parse_side, "N",
             "texels a side of a patch's tile at most, 2^k + 1 (default: 129)");
  add_parsed(*stage, "--min-component", options->bake.min_component, parse_component, "PERCENT",
             "leave out parts with less than this share of the area (default: 0.1; 0: keep all)");
}

}  // namespace rbvh
