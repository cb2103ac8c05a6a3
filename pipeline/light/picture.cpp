#include "pipeline/light/picture.h"

#include <utility>

#include "pipeline/light/bake_layer.h"
#include "pipeline/light/soft_look.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/render/edges.h"
#include "pipeline/render/pixels.h"

namespace rbvh {
namespace {

Image light_by_layer(const PictureSubject& of, const Camera& camera, const RenderConfig& shown,
                     const std::string& layer, RenderTimings& timings) {
  const Level* level = of.asset.rbvh() ? of.asset.rbvh()->find_level(of.level) : nullptr;
  return render_cached(of.primary, baked_layer(of.asset, level, layer), camera, shown.width, shown.height,
                       shown.samples > 0 ? shown.samples : kShadedSamples, &timings);
}

Picture light_by_paths(const PictureSubject& of, const Camera& camera, const RenderConfig& shown,
                       const Lighting& lighting, RenderTimings& timings, const Progress& progress) {
  PathConfig config = lighting.paths;
  config.width = shown.width;
  config.height = shown.height;
  config.colors = shown.colors;
  if (shown.samples > 0) config.samples = shown.samples;
  if (lighting.ground) config.ground = ground_below(of.asset, shown.up);
  config.offset = path_offset(of.asset, of.level, of.secondary_level);
  if (shown.aov == Aov::kOcclusion)
    return {.image = trace_ambient_occlusion(of.primary, of.secondary, camera,
                                             static_cast<float>(lighting.distance), config, progress)};
  const Environment environment = make_environment(lighting.words, camera, shown.up);
  PathPicture traced = trace_paths(of.primary, of.secondary, camera, environment, config, progress);
  timings.trace += traced.trace_seconds;
  timings.shade += traced.shade_seconds;
  timings.rays += traced.rays;
  return {
      .image = std::move(image_of(traced, shown.aov)), .path_samples = traced.samples, .noise = traced.noise};
}

Image light_softly(const PictureSubject& of, const Camera& camera, const RenderConfig& shown,
                   RenderTimings& timings, const Progress& progress) {
  constexpr float kReach = 0.25f;  // of the diagonal: what occludes
  const SoftLook look{.offset = path_offset(of.asset, of.level, of.secondary_level),
                      .reach = kReach * of.asset.bounds.diagonal(),
                      .outlines = of.asset.is_cloud};
  return render_soft(of.primary, of.secondary, camera, shown, look, timings, progress);
}

Picture light(const PictureSubject& of, const Camera& camera, const RenderConfig& shown,
              const Lighting& lighting, RenderTimings& timings, const Progress& progress) {
  Picture picture;
  if (!lighting.cached.empty())
    picture.image = light_by_layer(of, camera, shown, lighting.cached, timings);
  else if (!lighting.words.light.empty())
    picture = light_by_paths(of, camera, shown, lighting, timings, progress);
  else if (lighting.quick || shown.aov != Aov::kShaded)
    return {.image = render(of.primary, camera, shown, &timings)};
  else
    picture.image = light_softly(of, camera, shown, timings, progress);
  if (shown.aov == Aov::kShaded && shown.as_shown && !lighting.linear) apply_filmic_curve(picture.image);
  return picture;
}

}  // namespace

Picture draw_picture(const PictureSubject& subject, const Camera& camera, RenderConfig shown,
                     const Lighting& lighting, const Look& look, RenderTimings& timings,
                     const Progress& progress) {
  ValueColors values;
  if (!look.colored.name.empty()) values = value_colors(subject.asset, subject.level, look.colored);
  shown.colors = values.colors;
  Picture picture = light(subject, camera, shown, lighting, timings, progress);
  picture.is_empty = shows_nothing(picture.image);
  if (look.edges) draw_edges(subject.primary, camera, picture.image);
  const Depicted depicted{subject.asset, subject.level, Vec3d(shown.up), look.colored.map, values.range};
  if (picture.image.channels.size() == 4)
    picture.texts = decorate(look.decoration, camera, depicted, picture.image);
  return picture;
}

}  // namespace rbvh
