#include "cli/measure.h"

#include <filesystem>

#include "io/image.h"
#include "pipeline/proxy/proxy_surface.h"
#include "pipeline/render/difference.h"
#include "pipeline/render/shade.h"

namespace rbvh {
namespace {

constexpr std::size_t kDistanceSamples = 200'000;
constexpr double kControlOffset = 0.25;  // where in the pixel, both ways; the pictures' own rays are at 0.5

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
    const TriangleSoup level_surface = surface_of(*pair.rbvh()->find_level(measures[i].level));
    measures[i].to_scan = sampled_distance(level_surface, scan_points, kDistanceSamples);
    measures[i].to_level = sampled_distance(scan_surface, ClosestPoint(level_surface), kDistanceSamples);
  }
}

}  // namespace

std::vector<LevelMeasure> measure_levels(Context& context, const Device& device, const Subject& pair,
                                         const Subject& exact, const std::vector<std::string>& levels,
                                         const MeasureConfig& config) {
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

LevelFidelity stored_fidelity(const ViewsFidelity& views) {
  LevelFidelity f{};
  f.mask_mismatch_percent = static_cast<float>(views.all.mismatch_percent());
  f.median_dt = static_cast<float>(views.all.dt.median);
  f.p99_dt = static_cast<float>(views.all.dt.p99);
  f.holes = static_cast<std::uint32_t>(views.worst_holes);
  f.leaks = static_cast<std::uint32_t>(views.worst_leaks);
  f.walls = static_cast<std::uint32_t>(views.worst_walls);
  f.measured = true;
  return f;
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
