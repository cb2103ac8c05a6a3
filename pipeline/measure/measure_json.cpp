#include "pipeline/measure/measure_json.h"

#include <charconv>
#include <cmath>

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

Json distribution_json(const Distribution& d) {
  return {{"median", d.median}, {"p95", d.p95}, {"p99", d.p99}, {"p99.9", d.p999}, {"max", d.max}};
}

Json image_json(const ImageError& e) { return {{"rmse", e.rmse}, {"psnr", e.psnr}, {"ssim", e.ssim}}; }

Json distance_json(const DistanceStatistics& d, const LevelMeasure& m) {
  return {{"rms_percent", 100 * d.rms / m.diagonal},
          {"max_percent", 100 * d.max / m.diagonal},
          {"rms_texels", d.rms / m.texel},
          {"max_texels", d.max / m.texel}};
}

}  // namespace

Json float_json(float value) {
  if (!std::isfinite(value)) return nullptr;
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return Json::parse(text, end, nullptr, false);
}

Json measure_json(const LevelMeasure& m) {
  const HitFidelity& all = m.views.all;
  Json views = Json::array();
  for (const HitFidelity& view : m.views.views)
    views.push_back({{"pixels", view.pixels},
                     {"holes", view.holes},
                     {"leaks", view.leaks},
                     {"walls", view.walls},
                     {"mask_mismatch_percent", view.mismatch_percent()},
                     {"dt_median", view.dt.median},
                     {"dt_p99", view.dt.p99}});
  return {{"level", m.level},
          {"pixels", all.pixels},
          {"holes", all.holes},
          {"leaks", all.leaks},
          {"walls", all.walls},
          {"worst_view",
           {{"holes", m.views.worst_holes}, {"leaks", m.views.worst_leaks}, {"walls", m.views.worst_walls}}},
          {"mask_mismatch_percent", all.mismatch_percent()},
          {"mismatch_at_silhouette_percent", all.silhouette_percent()},
          {"dt", distribution_json(all.dt)},
          {"normal_degrees", distribution_json(all.normal_degrees)},
          {"image", image_json(m.image)},
          {"image_control", image_json(m.control)},
          {"image_relative", m.control.rmse > 0 ? Json(m.image.rmse / m.control.rmse) : Json(nullptr)},
          {"level_to_scan", distance_json(m.to_scan, m)},
          {"scan_to_level", distance_json(m.to_level, m)},
          {"views", std::move(views)}};
}

Json fidelity_json(const LevelFidelity& f) {
  if (!f.measured) return nullptr;
  Json json = {{"mask_mismatch_percent", float_json(f.mask_mismatch_percent)},
               {"median_dt", float_json(f.median_dt)},
               {"p99_dt", float_json(f.p99_dt)},
               {"holes", f.holes},
               {"leaks", f.leaks},
               {"walls", f.walls}};
  const LevelMeasures& m = f.more;
  if (m.views == 0) return json;
  const auto percent = [](float value) { return 100 * static_cast<double>(value); };
  const auto texels = [&](float value) { return m.texel > 0 ? static_cast<double>(value / m.texel) : 0.0; };
  const auto distance = [&](float rms, float max) {
    return Json{{"rms_percent", percent(rms)},
                {"max_percent", percent(max)},
                {"rms_texels", texels(rms)},
                {"max_texels", texels(max)}};
  };
  const auto image = [&](float rmse, float psnr, float ssim) {
    return Json{{"rmse", float_json(rmse)}, {"psnr", float_json(psnr)}, {"ssim", float_json(ssim)}};
  };
  json["mismatch_at_silhouette_percent"] = float_json(m.silhouette_percent);
  json["p999_dt"] = float_json(m.p999_dt);
  json["normal_degrees"] = {{"median", float_json(m.median_normal)}, {"p95", float_json(m.p95_normal)}};
  json["image"] = image(m.image_rmse, m.image_psnr, m.image_ssim);
  json["image_control"] = image(m.control_rmse, m.control_psnr, m.control_ssim);
  json["image_relative"] = m.control_rmse > 0 ? Json(m.image_rmse / m.control_rmse) : nullptr;
  json["level_to_scan"] = distance(m.to_scan_rms, m.to_scan_max);
  json["scan_to_level"] = distance(m.to_level_rms, m.to_level_max);
  json["views"] = m.views;
  json["resolution"] = m.resolution;
  return json;
}

Json measure_json(const LevelMeasure& measure, const ViewsConfig& views, const Level& level,
                  std::string& difference) {
  Json json = measure_json(measure);
  json["stored"] = fidelity_json(level.fidelity);
  json["as_stored"] = nullptr;
  difference.clear();
  const LevelMeasures& stored = level.fidelity.more;
  if (stored.views != static_cast<std::uint32_t>(views.views) || stored.resolution != views.resolution)
    return json;
  difference = find_difference(level.fidelity, stored_fidelity(measure, views));
  json["as_stored"] = difference.empty();
  return json;
}

Json proxy_measure_json(const ProxyMeasure& measure) {
  const auto json = [&](const DistanceStatistics& d) -> Json {
    return {{"rms_percent", 100 * d.rms / measure.diagonal}, {"max_percent", 100 * d.max / measure.diagonal}};
  };
  return {{"proxy_to_scan", json(measure.to_scan)}, {"scan_to_proxy", json(measure.to_proxy)}};
}

}  // namespace rbvh
