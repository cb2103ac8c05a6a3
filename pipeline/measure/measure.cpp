#include "rbvh/measure.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "pipeline/base/text.h"
#include "pipeline/measure/fidelity.h"
#include "pipeline/measure/image_error.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/render/shade.h"
#include "pipeline/trace/camera_rays.h"
#include "pipeline/trace/make_tracer.h"

namespace rbvh {
namespace {

constexpr std::size_t kDistanceSamples = 200'000;
// While two views are compared: their hits, their pictures, what is made of these.
constexpr std::uint64_t kBytesPerPixel = 200;
constexpr std::uint64_t kBytesPerSurfaceTexel = 200;  // two triangles and their hierarchy
constexpr double kControlOffset = 0.25;  // where in the pixel, both ways; the pictures' own rays are at 0.5

void add(ImageError& sum, const ImageError& error, double weight) {
  sum.rmse += error.rmse * weight;
  sum.psnr += error.psnr * weight;
  sum.ssim += error.ssim * weight;
}

/// The shaded pictures of the view being measured: the exact one and its control are shared by all levels.
class Pictures {
 public:
  Pictures(const Tracer& exact, Vec3f up) : exact_tracer_(exact), up_(up) {}

  void compare(const MeasuredView& view, const Tracer& level, double weight, LevelMeasure& measure) {
    if (view.view != view_) {
      view_ = view.view;
      exact_ = picture(exact_tracer_, view.rays, view.exact);
      const CameraRays aside =
          camera_rays(view.camera, view.rays.width, view.rays.height, kControlOffset, kControlOffset);
      control_ = compare_images(exact_, picture(exact_tracer_, aside, intersect(exact_tracer_, aside)));
    }
    add(measure.image, compare_images(exact_, picture(level, view.rays, view.hits)), weight);
    add(measure.control, control_, weight);
  }

 private:
  Image picture(const Tracer& tracer, const CameraRays& rays, std::span<const Hit> hits) const {
    return shade(rays, hits, tracer.surface(hits, sample_spread(rays, 1)), up_);
  }

  const Tracer& exact_tracer_;
  Vec3f up_;
  int view_ = -1;
  Image exact_;
  ImageError control_;
};

void measure_distances(const Rbvh& rbvh, const Scan& scan, const std::string& path,
                       const MeasureConfig& config, const Progress& progress,
                       std::vector<LevelMeasure>& measures) {
  const TriangleSoup scan_surface = surface_of(scan);
  const ClosestPoint scan_points(scan_surface);
  for (std::size_t i = 0; i < measures.size(); ++i) {
    report(progress, "surface distance", static_cast<double>(i) / static_cast<double>(measures.size()));
    const Level& level = *rbvh.find_level(measures[i].level);
    check_budget(config.memory, level.texels_used * kBytesPerSurfaceTexel, path,
                 "measuring the distance of its surface");
    const TriangleSoup level_surface = surface_of(level);
    measures[i].to_scan = sampled_distance(level_surface, scan_points, kDistanceSamples);
    measures[i].to_level = sampled_distance(scan_surface, ClosestPoint(level_surface), kDistanceSamples);
  }
}

}  // namespace

std::optional<std::string> find_other_scan(const Asset& pair, const Asset& exact) {
  const RbvhSource& source = pair.rbvh()->source;
  if (std::max(length(exact.bounds.lo - source.bounds.lo), length(exact.bounds.hi - source.bounds.hi)) <=
      0.05f * source.bounds.diagonal())
    return {};
  const auto size = [](std::uint64_t vertices, std::uint64_t triangles) {
    return triangles > 0 ? counted(triangles, "triangle") : counted(vertices, "point");
  };
  return "does not lie where the scan that " + pair.path + " was built of does; is it another? It has " +
         size(exact.scan()->positions.size(), exact.scan()->triangles.size()) + ", and " + source.name +
         " had " + size(source.vertices, source.triangles);
}

std::vector<LevelMeasure> measure_levels(const Device& device, const Asset& pair, const Asset& exact,
                                         const std::vector<std::string>& levels, const MeasureConfig& config,
                                         const Progress& progress) {
  check_budget(config.memory,
               std::uint64_t{config.views.resolution} * config.views.resolution *
                   (kBytesPerPixel + levels.size() * static_cast<std::uint64_t>(config.views.views)),
               exact.path, "comparing views of that resolution");
  check_tracer_budget(config.memory, exact, {});
  const std::unique_ptr<Tracer> exact_tracer = make_tracer(device, exact);
  std::vector<LevelMeasure> measures;
  std::vector<std::unique_ptr<Tracer>> tracers;
  std::vector<CastView> casts;
  for (const std::string& level : levels) {
    LevelMeasure measure;
    measure.level = level;
    measure.image = measure.control = {0, 0, 0};  // sums at first
    measure.diagonal = static_cast<double>(exact.bounds.diagonal());
    measure.texel = texel_side(*pair.rbvh()->find_level(level));
    measures.push_back(measure);
    tracers.push_back(make_tracer(device, pair, level, SceneConfig{}));
    casts.push_back([&tracer = *tracers.back()](const CameraRays& rays) { return intersect(tracer, rays); });
  }
  ViewsConfig views = config.views;
  views.up_axis = exact.up_axis();
  Pictures pictures(*exact_tracer, static_cast<Vec3f>(views.up_axis));
  const auto on_view = [&](const MeasuredView& view) {
    if (config.images) pictures.compare(view, *tracers[view.level], 1.0 / views.views, measures[view.level]);
    if (config.on_view) config.on_view(view);
  };
  const std::vector<ViewsFidelity> results =
      measure_views([&](const CameraRays& rays) { return intersect(*exact_tracer, rays); }, casts,
                    exact.bounds, views, progress, on_view);
  for (std::size_t i = 0; i < results.size(); ++i) measures[i].views = results[i];
  if (config.distances) measure_distances(*pair.rbvh(), *exact.scan(), pair.path, config, progress, measures);
  return measures;
}

}  // namespace rbvh
