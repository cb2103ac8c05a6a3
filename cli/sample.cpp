// rbvh sample: reads a layer at points on the surface.
#include <cmath>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/layer_options.h"
#include "cli/stages.h"
#include "io/npy.h"
#include "io/output_file.h"
#include "io/rbvh_file.h"
#include "pipeline/rbvh/layer_sampling.h"

namespace rbvh {
namespace {

struct SampleOptions {
  std::string file, layer, points;
  std::vector<std::string> levels;
  std::optional<float> reach;
  bool shifted = false;
};

void run_sample(Context& context, const SampleOptions& options) {
  check_paths_differ(context, {options.file, atlas_path(options.file), options.points}, {context.output});
  check_output(context.output, context.force);
  check_is_pair(options.file);
  check_read_budget(context.memory, options.points);
  const Asset pair = load(context, options.file, {.levels = options.levels});
  const std::vector<Vec3f> points = read_points(options.points, given_shift(pair, options.shifted));
  const Level& level = *pair.rbvh()->find_level(levels_to_cast(context, pair, options.levels).front());
  const Layer layer = layer_to_sample(level, options.layer, options.file);
  time_phase(context, "load");
  const Device device = open_device(context);
  const std::vector<float> values = sample_layer(make_point_index(device, level), level, layer, points,
                                                 options.reach.value_or(default_reach(*pair.rbvh())));
  time_phase(context, "sample");
  const std::size_t width = sample_width(layer);
  write_npy(context.output, values, width, context.force);
  time_phase(context, "write");
  std::uint64_t missed = 0;
  for (std::size_t i = 0; i < values.size(); i += width) missed += std::isnan(values[i]);
  if (missed > 0)
    detail(context, "rbvh sample: " + counted(missed, "point") + " where the layer has no value");
  context.report["counts"] = {{"points", points.size()}, {"without_value", missed}};
  context.report["bytes"] = values.size() * sizeof(float);
  context.report["level"] = level.name;
}

}  // namespace

void add_sample(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"sample", "Read a pair's layer at points on its surface",
                 "rbvh sample dragon.rbvh --layer wear --points p.npy -o values.npy"},
                kWithOutput | kWithDevice | kWithReport, run_sample);
  stage->add_option("FILE", options->file, "an .rbvh pair")->required();
  add_parsed(
      *stage, "--layer", options->layer, parse_name, "NAME",
      "which: of your own, or normal (3 values), color (3, sRGB from 0 to 1), height (how far the surface "
      "lies above the point)")
      ->required();
  stage
      ->add_option("--points", options->points,
                   "N x 3 float32 or float64 (-: standard input). Out come N x the layer's values, nan where "
                   "there is none")
      ->required()
      ->type_name("FILE");
  add_parsed(*stage, "--reach", options->reach, parse_distance, "D",
             "how far from the surface a point may lie, scan units (default: 1% of the diagonal)");
  add_coordinates_option(*stage, options->shifted);
  add_level_option(*stage, options->levels, false);
}

}  // namespace rbvh
