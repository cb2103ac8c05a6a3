#include "pipeline/measure/measure_levels.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <tuple>

#include "pipeline/base/text.h"
#include "pipeline/proxy/proxy_surface.h"
#include "pipeline/render/shade.h"
#include "pipeline/trace/make_tracer.h"

namespace rbvh {
namespace {

constexpr std::size_t kDistanceSamples = 200'000;
// While two views are compared: their hits, their pictures, what is made of these.
constexpr std::uint64_t kBytesPerPixel = 200;
constexpr std::uint64_t kBytesPerSurfaceTexel = 200;  // two triangles and their hierarchy
constexpr double kControlOffset = 0.25;  // where in the pixel, both ways; the pictures' own rays are at 0.5

std::string three_digits(float value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", static_cast<double>(value));
  return text;
}

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
    return shade(rays, hits, tracer.surface(hits), up_);
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
    tracers.push_back(make_tracer(device, pair, {.level = level, .scene = {}, .spread = 0}));
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
  const MeasureConfig config{.views = views, .images = true, .distances = true, .memory = memory};
  for (const LevelMeasure& measure : measure_levels(device, pair, exact, levels, config, progress))
    for (Level& level : std::get<Rbvh>(pair.content).levels)
      if (level.name == measure.level) level.fidelity = stored_fidelity(measure, views);
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

ProxyMeasure measure_proxy(const Proxy& proxy, const Scan& scan) {
  const TriangleSoup from = surface_of(scan), to = surface_of(proxy);
  return {sampled_distance(to, ClosestPoint(from), kDistanceSamples),
          sampled_distance(from, ClosestPoint(to), kDistanceSamples), bounds(scan).diagonal()};
}

}  // namespace rbvh
