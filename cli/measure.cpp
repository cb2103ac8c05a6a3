#include "cli/measure.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <tuple>

#include "cli/exact_options.h"
#include "io/image.h"
#include "pipeline/proxy/proxy_surface.h"
#include "pipeline/render/difference.h"
#include "pipeline/render/shade.h"

namespace rbvh {
namespace {

constexpr std::size_t kDistanceSamples = 200'000;
// While two views are compared: their hits, their pictures, what is made of these.
constexpr std::uint64_t kBytesPerPixel = 200;
constexpr std::uint64_t kBytesPerSurfaceTexel = 200;  // two triangles and their hierarchy
constexpr double kControlOffset = 0.25;  // where in the pixel, both ways; the pictures' own rays are at 0.5

std::uint32_t parse_side(std::string_view text) {
  const std::int64_t side = parse_integer(text);
  if (side < 16 || side > 16384)
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not between 16 and 16384 pixels");
  return static_cast<std::uint32_t>(side);
}

void add(ImageError& sum, const ImageError& error, double weight) {
  sum.rmse += error.rmse * weight;
  sum.psnr += error.psnr * weight;
  sum.ssim += error.ssim * weight;
}

// The shaded pictures of the view being measured: the exact one and its control are shared by all levels.
class Pictures {
 public:
  Pictures(const Subject& pair, const Subject& exact, const Caster& exact_caster, Vec3f up)
      : pair_(pair),
        scan_(*exact.scan()),
        exact_caster_(exact_caster),
        normals_(shading_normals(scan_)),
        up_(up) {}

  void compare(const MeasuredView& view, const std::string& level, double weight, LevelMeasure& measure) {
    if (view.view != view_) {
      view_ = view.view;
      exact_ = shade(view.rays, view.exact, sample_surface(scan_, normals_, view.exact), up_);
      const CameraRays aside =
          camera_rays(view.camera, view.rays.width, view.rays.height, kControlOffset, kControlOffset);
      const std::vector<Hit> hits = cast_camera(exact_caster_, aside);
      control_ = compare_images(exact_, shade(aside, hits, sample_surface(scan_, normals_, hits), up_));
    }
    const SurfaceSamples surface = sample_surface(*pair_.rbvh()->find_level(level), view.hits);
    add(measure.image, compare_images(exact_, shade(view.rays, view.hits, surface, up_)), weight);
    add(measure.control, control_, weight);
  }

 private:
  const Subject& pair_;
  const Scan& scan_;
  const Caster& exact_caster_;
  std::vector<Vec3f> normals_;
  Vec3f up_;
  int view_ = -1;
  Image exact_;
  ImageError control_;
};

void measure_distances(Context& context, const Subject& pair, const Scan& scan,
                       std::vector<LevelMeasure>& measures) {
  const Progress progress = context.progress.callback();
  const TriangleSoup scan_surface = surface_of(scan);
  const ClosestPoint scan_points(scan_surface);
  for (std::size_t i = 0; i < measures.size(); ++i) {
    report(progress, "surface distance", static_cast<double>(i) / static_cast<double>(measures.size()));
    const Level& level = *pair.rbvh()->find_level(measures[i].level);
    check_budget(context, level.texels_used * kBytesPerSurfaceTexel, pair.path,
                 "measuring the distance of its surface");
    const TriangleSoup level_surface = surface_of(level);
    measures[i].to_scan = sampled_distance(level_surface, scan_points, kDistanceSamples);
    measures[i].to_level = sampled_distance(scan_surface, ClosestPoint(level_surface), kDistanceSamples);
  }
}

}  // namespace

void add_views_options(CLI::App& stage, ViewsConfig& views, const std::string& with) {
  add_parsed(stage, "--views", views.views, parse_positive, "N", "how many views to measure in (default: 8)")
      ->needs(with);
  add_parsed(stage, "--resolution", views.resolution, parse_side, "N",
             "pixels of such a view, both ways (default: 1024)")
      ->needs(with);
}

void move_to_shift(Scan& scan, const Vec3d& shift) {
  if (scan.shift == shift) return;
  const Vec3d difference = scan.shift - shift;
  for (Vec3f& p : scan.positions) p = Vec3f(Vec3d(p) + difference);
  scan.shift = shift;
}

Subject load_against(Context& context, const Subject& pair, const std::string& path) {
  Scan scan = load_exact_scan(context, path);
  move_to_shift(scan, pair.rbvh()->source.shift);
  Subject exact;
  exact.path = path;
  exact.bounds = bounds(scan);
  exact.is_cloud = scan.is_cloud();
  exact.content = std::move(scan);
  return exact;
}

std::optional<std::string> find_other_scan(const Subject& pair, const Subject& exact) {
  const RbvhSource& source = pair.rbvh()->source;
  if (std::max(length(exact.bounds.lo - source.bounds.lo), length(exact.bounds.hi - source.bounds.hi)) <=
      0.05f * source.bounds.diagonal())
    return {};
  const auto size = [](std::uint64_t vertices, std::uint64_t triangles) {
    return triangles > 0 ? counted(triangles, "triangle") : counted(vertices, "point");
  };
  return fmt::format(
      "does not lie where the scan that {} was built of does; is it another? It has {}, and {} had {}",
      pair.path, size(exact.scan()->positions.size(), exact.scan()->triangles.size()), source.name,
      size(source.vertices, source.triangles));
}

std::vector<LevelMeasure> measure_levels(Context& context, const Device& device, const Subject& pair,
                                         const Subject& exact, const std::vector<std::string>& levels,
                                         const MeasureConfig& config) {
  check_budget(context,
               std::uint64_t{config.views.resolution} * config.views.resolution *
                   (kBytesPerPixel + levels.size() * static_cast<std::uint64_t>(config.views.views)),
               exact.path, "comparing views of that resolution");
  check_exact_budget(context, exact, {});
  const Caster exact_caster = make_caster(device, exact, "exact");
  std::vector<LevelMeasure> measures;
  std::vector<CastView> casts;
  for (const std::string& level : levels) {
    LevelMeasure measure;
    measure.level = level;
    measure.image = measure.control = {0, 0, 0};  // sums at first
    measure.diagonal = static_cast<double>(exact.bounds.diagonal());
    measure.texel = texel_side(*pair.rbvh()->find_level(level));
    measures.push_back(measure);
    casts.push_back([caster = make_caster(device, pair, level)](const CameraRays& rays) {
      return cast_camera(caster, rays);
    });
  }
  ViewsConfig views = config.views;
  views.up_axis = exact.up_axis();
  Pictures pictures(pair, exact, exact_caster, static_cast<Vec3f>(views.up_axis));
  const auto on_view = [&](const MeasuredView& view) {
    if (config.images) pictures.compare(view, levels[view.level], 1.0 / views.views, measures[view.level]);
    if (!config.pictures.empty())
      write_image((std::filesystem::path(config.pictures) /
                   (levels[view.level] + "-" + std::to_string(view.view) + ".png"))
                      .string(),
                  difference_image(view.exact, view.hits, view.rays, exact.bounds.diagonal(), 2),
                  context.force);
  };
  const std::vector<ViewsFidelity> results =
      measure_views([&](const CameraRays& rays) { return cast_camera(exact_caster, rays); }, casts,
                    exact.bounds, views, context.progress.callback(), on_view);
  for (std::size_t i = 0; i < results.size(); ++i) measures[i].views = results[i];
  if (config.distances) measure_distances(context, pair, *exact.scan(), measures);
  return measures;
}

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

nlohmann::ordered_json fidelity_json(const LevelFidelity& f) {
  if (!f.measured) return nullptr;
  // The shortest decimal that is this float: 0.85, not 0.8500000238418579.
  const auto number = [](float value) -> nlohmann::ordered_json {
    if (!std::isfinite(value)) return nullptr;
    return nlohmann::ordered_json::parse(fmt::format("{}", value), nullptr, false);
  };
  nlohmann::ordered_json json = {{"mask_mismatch_percent", number(f.mask_mismatch_percent)},
                                 {"median_dt", number(f.median_dt)},
                                 {"p99_dt", number(f.p99_dt)},
                                 {"holes", f.holes},
                                 {"leaks", f.leaks},
                                 {"walls", f.walls}};
  const LevelMeasures& m = f.more;
  if (m.views == 0) return json;
  const auto percent = [](float value) { return 100 * static_cast<double>(value); };
  const auto texels = [&](float value) { return m.texel > 0 ? static_cast<double>(value / m.texel) : 0.0; };
  const auto distance = [&](float rms, float max) {
    return nlohmann::ordered_json{{"rms_percent", percent(rms)},
                                  {"max_percent", percent(max)},
                                  {"rms_texels", texels(rms)},
                                  {"max_texels", texels(max)}};
  };
  const auto image = [&](float rmse, float psnr, float ssim) {
    return nlohmann::ordered_json{{"rmse", number(rmse)}, {"psnr", number(psnr)}, {"ssim", number(ssim)}};
  };
  json["mismatch_at_silhouette_percent"] = number(m.silhouette_percent);
  json["p999_dt"] = number(m.p999_dt);
  json["normal_degrees"] = {{"median", number(m.median_normal)}, {"p95", number(m.p95_normal)}};
  json["image"] = image(m.image_rmse, m.image_psnr, m.image_ssim);
  json["image_control"] = image(m.control_rmse, m.control_psnr, m.control_ssim);
  json["image_relative"] =
      m.control_rmse > 0 ? nlohmann::ordered_json(m.image_rmse / m.control_rmse) : nullptr;
  json["level_to_scan"] = distance(m.to_scan_rms, m.to_scan_max);
  json["scan_to_level"] = distance(m.to_level_rms, m.to_level_max);
  json["views"] = m.views;
  json["resolution"] = m.resolution;
  return json;
}

double error_percent(const LevelFidelity& f) {
  if (!f.measured || f.more.views == 0) return std::numeric_limits<double>::quiet_NaN();
  return 100 * static_cast<double>(std::max(f.more.to_scan_rms, f.more.to_level_rms));
}

std::string find_difference(const LevelFidelity& stored, const LevelFidelity& found) {
  const LevelMeasures &a = stored.more, &b = found.more;
  const std::tuple<const char*, std::uint32_t, std::uint32_t> counts[] = {
      {"holes", stored.holes, found.holes},
      {"leaks", stored.leaks, found.leaks},
      {"walls", stored.walls, found.walls}};
  for (const auto& [name, was, is] : counts)
    if (is > was + std::max(2u, was / 4)) return fmt::format("{} {}, where the file says {}", is, name, was);
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
      return fmt::format("{:.3g} {}, where the file says {:.3g}", f.is * f.scale, f.name, f.was * f.scale);
  }
  return {};
}

ProxyMeasure measure_proxy(const Proxy& proxy, const Scan& scan) {
  const TriangleSoup from = surface_of(scan), to = surface_of(proxy);
  return {sampled_distance(to, ClosestPoint(from), kDistanceSamples),
          sampled_distance(from, ClosestPoint(to), kDistanceSamples), bounds(scan).diagonal()};
}

nlohmann::ordered_json proxy_measure_json(const ProxyMeasure& measure) {
  const auto json = [&](const DistanceStatistics& d) -> nlohmann::ordered_json {
    return {{"rms_percent", 100 * d.rms / measure.diagonal}, {"max_percent", 100 * d.max / measure.diagonal}};
  };
  return {{"proxy_to_scan", json(measure.to_scan)}, {"scan_to_proxy", json(measure.to_proxy)}};
}

}  // namespace rbvh
