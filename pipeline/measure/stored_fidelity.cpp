#include "pipeline/measure/stored_fidelity.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <tuple>
#include <utility>

#include "pipeline/scene/asset_content.h"

namespace rbvh {
namespace {

std::string three_digits(float value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", static_cast<double>(value));
  return text;
}

}  // namespace

LevelFidelity stored_fidelity(const LevelMeasure& measure, const ViewsConfig& config) {
  const ViewsFidelity& views = measure.views;
  const auto narrow = [](double value) { return static_cast<float>(value); };
  LevelFidelity f{};
  f.mask_mismatch_percent = static_cast<float>(views.all.mismatch_percent());
  f.median_dt = static_cast<float>(views.all.dt.median);
  f.p99_dt = static_cast<float>(views.all.dt.p99);
  f.holes = static_cast<std::uint32_t>(views.worst_holes);
  f.leaks = static_cast<std::uint32_t>(views.worst_leaks);
  f.walls = static_cast<std::uint32_t>(views.worst_walls);
  // No ray that hit both: nothing was measured that could be kept.
  f.measured = !std::isnan(f.median_dt);
  if (!f.measured) return f;
  LevelMeasures& m = f.more;
  m.silhouette_percent = narrow(views.all.silhouette_percent());
  m.p999_dt = narrow(views.all.dt.p999);
  m.median_normal = narrow(views.all.normal_degrees.median);
  m.p95_normal = narrow(views.all.normal_degrees.p95);
  m.image_rmse = narrow(measure.image.rmse);
  m.image_psnr = narrow(measure.image.psnr);
  m.image_ssim = narrow(measure.image.ssim);
  m.control_rmse = narrow(measure.control.rmse);
  m.control_psnr = narrow(measure.control.psnr);
  m.control_ssim = narrow(measure.control.ssim);
  m.to_scan_rms = narrow(measure.to_scan.rms / measure.diagonal);
  m.to_scan_max = narrow(measure.to_scan.max / measure.diagonal);
  m.to_level_rms = narrow(measure.to_level.rms / measure.diagonal);
  m.to_level_max = narrow(measure.to_level.max / measure.diagonal);
  m.texel = narrow(measure.texel / measure.diagonal);
  m.views = static_cast<std::uint32_t>(config.views);
  m.resolution = config.resolution;
  return f;
}

void measure_and_store(const Device& device, Asset& pair, const Asset& exact,
                       const std::vector<std::string>& levels, const ViewsConfig& views,
                       const MemoryBudget& memory, const Progress& progress) {
  MeasureConfig config;
  config.views = views;
  config.images = config.distances = true;
  config.memory = memory;
  for (const LevelMeasure& measure : measure_levels(device, pair, exact, levels, config, progress))
    for (Level& level : pair.rbvh()->levels)
      if (level.name == measure.level) level.fidelity = stored_fidelity(measure, views);
}

void measure_and_store(const Device& device, Rbvh& rbvh, Scan& scan, const ViewsConfig& views,
                       const MemoryBudget& memory, const Progress& progress) {
  Asset exact = make_asset(std::move(scan)), pair = make_asset(std::move(rbvh));
  measure_and_store(device, pair, exact, level_names(pair), views, memory, progress);
  scan = std::move(*exact.scan());
  rbvh = std::move(*pair.rbvh());
}

std::string find_difference(const LevelFidelity& stored, const LevelFidelity& found) {
  const LevelMeasures &a = stored.more, &b = found.more;
  const std::tuple<const char*, std::uint32_t, std::uint32_t> counts[] = {
      {"holes", stored.holes, found.holes},
      {"leaks", stored.leaks, found.leaks},
      {"walls", stored.walls, found.walls}};
  for (const auto& [name, was, is] : counts)
    if (is > was + std::max(2u, was / 4))
      return std::to_string(is) + " " + name + ", where the file says " + std::to_string(was);
  struct Figure {
    const char* name;
    float was, is, scale;
  };
  const Figure figures[] = {
      {"% mask mismatch", stored.mask_mismatch_percent, found.mask_mismatch_percent, 1},
      {"of the diagonal as median |dt|", stored.median_dt, found.median_dt, 1},
      {"of the diagonal as p99 of |dt|", stored.p99_dt, found.p99_dt, 1},
      {"% of the diagonal from level to scan (rms)", a.to_scan_rms, b.to_scan_rms, 100},
      {"% of the diagonal from scan to level (rms)", a.to_level_rms, b.to_level_rms, 100}};
  for (const Figure& f : figures) {
    if (f.is > 1.25f * f.was + 1e-6f)
      return three_digits(f.is * f.scale) + " " + f.name + ", where the file says " +
             three_digits(f.was * f.scale);
  }
  return {};
}

}  // namespace rbvh
