// Light kept in a level's layers, and pictures drawn with it.
#include "pipeline/light/bake_layer.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/light/path_wave.h"
#include "pipeline/light/sobol.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/point_query.h"

namespace rbvh {
namespace {

/// Unit normals of the level's surface at its points; those that have none are left out.
void keep_points_with_normals(const Device& device, const Level& level, LayerPoints& at,
                              std::vector<Vec3f>& normals, const std::string& file) {
  const Layer layer = layer_to_sample(level, "normal", file);
  const std::vector<float> found =
      sample_layer(make_point_index(device, level), level, layer, at.points, level.bounds.diagonal());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < at.points.size(); ++i) {
    const Vec3f normal = normalized(Vec3f{found[3 * i], found[3 * i + 1], found[3 * i + 2]});
    if (!is_finite(normal) || !(dot(normal, normal) > 0)) continue;
    at.points[kept] = at.points[i];
    at.texels[kept++] = at.texels[i];
    normals.push_back(normal);
  }
  at.points.resize(kept);
  at.texels.resize(kept);
}

}  // namespace

std::uint64_t bake_layer(const Device& device, const Tracer& tracer, Level& level, const BakeLayer& bake,
                         const Environment& environment, const PathConfig& config, const std::string& file,
                         const Progress& progress) {
  const bool is_occlusion = bake.light == BakedLight::kOcclusion;
  Layer layer = make_layer(level, bake.name, is_occlusion ? 1 : 3, bake.scale);
  LayerPoints at = layer_points(level, layer);
  std::vector<Vec3f> normals;
  keep_points_with_normals(device, level, at, normals, file);
  std::vector<float> values;
  if (is_occlusion) {
    values = gather_occlusion(tracer, at.points, normals, bake.distance, config, progress);
  } else {
    PathConfig paths = config;
    if (bake.light == BakedLight::kSky) paths.max_bounces = 1;
    for (const Vec3f& light : gather_light(tracer, at.points, normals, environment, paths, progress))
      values.insert(values.end(), {light.x, light.y, light.z});
  }
  set_values(layer, at.texels, values);
  std::erase_if(level.layers, [&](const Layer& old) { return old.name == bake.name; });
  level.layers.push_back(std::move(layer));
  return at.points.size();
}

LitLevel baked_layer(const Asset& asset, const Level* level, const std::string& name) {
  const Layer* layer = level != nullptr ? find_layer(*level, name) : nullptr;
  if (layer == nullptr || layer_kind(name) != LayerKind::kUser)
    throw Error(ErrorKind::kUsage, asset.path,
                "there is no layer '" + name + "' of light" + (level != nullptr ? " in " + level->name : ""));
  return {level, layer};
}

Image render_cached(const Tracer& tracer, const LitLevel& lit, const Camera& camera, std::uint32_t width,
                    std::uint32_t height, int samples, RenderTimings* timings) {
  RBVH_CHECK(samples > 0);
  const std::size_t channels = sample_width(*lit.light);
  RenderTimings unasked;
  RenderTimings& times = timings != nullptr ? *timings : unasked;
  Image picture = make_image(Image::Kind::kColor, width, height, {"R", "G", "B", "A"});
  CameraHits cast;
  Stopwatch watch;
  for (int sample = 0; sample < samples; ++sample) {
    const auto offset = sobol_point(static_cast<std::uint32_t>(sample), 0, 0);
    const CameraRays rays =
        camera_rays(camera, width, height, samples > 1 ? static_cast<double>(offset[0]) : 0.5,
                    samples > 1 ? static_cast<double>(offset[1]) : 0.5);
    intersect(tracer, rays, false, cast);
    times.trace += watch.lap();
    times.rays += cast.hits.size();
    const SurfaceSamples surface = tracer.surface(cast.hits, sample_spread(rays, samples));
    const std::vector<float> values = sample_layer_at_hits(*lit.level, *lit.light, cast.hits);
    parallel_for(cast.hits.size(), kPathGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (cast.hits[i].leaf == RBVH_NO_LEAF) continue;
        const Vec3f albedo = surface.colors.empty() ? kClay : surface.colors[i];
        float* out = &picture.pixels[4 * i];
        for (std::size_t c = 0; c < 3; ++c) {
          const float value = values[i * channels + std::min(c, channels - 1)];
          out[c] +=
              std::isfinite(value) ? albedo[static_cast<int>(c)] * value / static_cast<float>(samples) : 0;
        }
        out[3] += 1 / static_cast<float>(samples);
      }
    });
    times.shade += watch.lap();
  }
  return picture;
}

}  // namespace rbvh
