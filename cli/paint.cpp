// rbvh paint: writes values to a layer, at points on the surface or from a scan's vertices.

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/layer_options.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "io/npy.h"
#include "io/rbvh_file.h"
#include "pipeline/rbvh/layer_painting.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/layers.h"

namespace rbvh {
namespace {

struct PaintOptions {
  std::string file, layer, points, values, scan;
  std::vector<std::string> levels;
  float radius = 0;
  bool shifted = false;
  std::optional<double> scale;
  std::optional<float> reach;
};

void check_words(const PaintOptions& options) {
  const bool from_scan = !options.scan.empty();
  if (from_scan == (!options.points.empty() || !options.values.empty()) ||
      options.points.empty() != options.values.empty())
    throw Error(ErrorKind::kUsage, "", "what is to be painted? --points with --values, or --scan");
  const LayerKind kind = layer_kind(options.layer);
  if (kind != LayerKind::kUser && (from_scan || kind != LayerKind::kColor))
    throw Error(ErrorKind::kUsage, "", "--layer: " + options.layer + " cannot be painted; take another name");
}

void run_paint(Context& context, const PaintOptions& options) {
  check_words(options);
  const bool from_scan = !options.scan.empty();
  const std::string output =
      change_output(context, options.file, {options.points, options.values, options.scan});

  PointValues paint;
  Scan scan;
  Asset pair = load(context, options.file);
  if (from_scan)
    scan = load_scan(options.scan, context.memory, context.progress.callback());
  else
    paint =
        read_point_values(options.points, options.values, context.memory, given_shift(pair, options.shifted));
  Rbvh& rbvh = *pair.rbvh();
  move_to_shift(scan, rbvh.source.shift);
  from_scan ? warn_of_infinite(context, options.scan, scan, options.layer)
            : warn_of_infinite(context, options.values, paint.values.values);
  const std::vector<std::string> levels = levels_to_cast(context, pair, or_all(options.levels));
  auto& report = context.report;
  time_phase(context, "load");
  PaintCounts counts;
  if (from_scan) {
    for (Level& level : rbvh.levels)
      if (std::find(levels.begin(), levels.end(), level.name) != levels.end())
        add_property_layers({&level, 1}, scan, {options.layer}, options.scale.value_or(1),
                            context.progress.callback());
  } else {
    const Device device = open_device(context);
    for (const auto& [level, painted] :
         paint_levels(device, rbvh, levels,
                      {options.layer, paint.points, paint.values.values, paint.values.columns, options.scale,
                       options.radius, options.reach},
                      options.file)) {
      report["levels"].push_back(
          {{"name", level}, {"texels", painted.texels}, {"missed", painted.points_missed}});
      counts.points_missed = std::max(counts.points_missed, painted.points_missed);
      counts.texels += painted.texels;
    }
  }
  if (counts.points_missed > 0)
    warn(context, options.points + ": " + std::to_string(counts.points_missed) + " of " +
                      std::to_string(paint.points.size()) +
                      " points paint nothing: further from the surface than --reach");
  time_phase(context, "paint");
  report["counts"] = {
      {"points", paint.points.size()}, {"missed", counts.points_missed}, {"texels", counts.texels}};
  write_pair(context, output, rbvh, "layer " + options.layer);
}

}  // namespace

void add_paint(CLI::App& app, Context& context) {
  const auto [stage, options] = add_stage(
      app, context,
      {"paint", "Write values to a layer of a pair: at points, or from a scan",
       "rbvh paint dragon.rbvh --layer wear --points p.npy --values v.npy --radius 0.01 -o painted.rbvh"},
      kWithOutput | kWithDevice | kWithReport, run_paint);
  add_change_output(*stage);
  stage->add_option("FILE", options->file, "an .rbvh pair")->required();
  add_parsed(*stage, "--layer", options->layer, parse_name, "NAME",
             "the layer, made where it is not there; or color")
      ->required();
  stage->add_option("--points", options->points, "N x 3 float32 or float64: points on the surface")
      ->type_name("FILE");
  add_coordinates_option(*stage, options->shifted);
  stage
      ->add_option(
          "--values", options->values,
          "N x 1 to N x 4 float32, one row a point; nan takes a value away; of color three, sRGB from 0 to 1")
      ->type_name("FILE");
  add_parsed(
      *stage, "--radius", options->radius, parse_distance, "R",
      "paints what lies within, scan units; of several points the nearest (default: only the texels that "
      "cover a point)");
  stage
      ->add_option("--scan", options->scan,
                   "instead of points: the scan's vertex property of the layer's name, everywhere")
      ->excludes("--radius")
      ->type_name("SCAN");
  add_parsed(*stage, "--layer-scale", options->scale, parse_layer_scale, "S",
             "of a new layer: its texels to one of the heights', 0.0625 to 16 (default: 1)");
  add_parsed(*stage, "--reach", options->reach, parse_distance, "D",
             "how far from the surface a point may lie, scan units (default: 1% of the diagonal)")
      ->excludes("--scan");
  add_level_option(*stage, options->levels, true);
}

}  // namespace rbvh
