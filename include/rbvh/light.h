// Light: what shines on a surface, what the surface is made of, and pictures by paths between them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/camera.h"
#include "rbvh/image.h"
#include "rbvh/progress.h"
#include "rbvh/render.h"
#include "rbvh/tracer.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// A disc at infinity of even radiance.
struct Sun {
  Vec3f direction{0, 1, 0};  ///< towards it, unit
  Vec3f radiance{};          ///< zero: there is none
  float angle = 0.0047f;     ///< its radius as seen, radians; above 0
};

/// Light from infinitely far away.
struct Environment {
  /// R G B, linear: latitude (row 0: `up`) by longitude, turning counterclockwise about `up`, seen from
  /// above, from the direction front_of(up). One pixel: the same light from everywhere. No pixel:
  /// none.
  Image sky;
  Vec3f up{0, 1, 0};  ///< unit
  Sun sun;
};

/// The same light from everywhere.
Environment uniform_environment(Vec3f radiance);
/// A large soft key light from the camera's upper left, a weaker one from its right, and a dim room.
Environment studio_environment(const Camera& camera);
/// A soft lamp, some 8 degrees wide, where the camera is seen from the object, in a dim room.
Environment headlight_environment(const Camera& camera);
/// A clear sky (Preetham, Shirley, Smits 1999) of that turbidity and its sun; scaled so that a white plane
/// that faces the zenith is as bright as under a uniform sky of radiance 1. `to_sun` is unit, at most 85
/// degrees off `up`.
Environment sky_environment(Vec3f up, Vec3f to_sun, float turbidity = 3);
/// The sun alone, with a little even light in the shadows; scaled alike.
Environment sun_environment(Vec3f up, Vec3f to_sun);

/// Light in words, as a user says them.
struct LightWords {
  std::string light = "studio";  ///< or "headlight", "sky", "sun", "white"; any other word: `map`
  struct Sun {
    double azimuth = 45;    ///< degrees, to the left of front_of(), seen from above
    double elevation = 45;  ///< degrees over the horizon, kLowestSun to 90
  } sun{};
  Image map{};  ///< latitude-longitude, as Environment.sky
};
inline constexpr double kLowestSun = 5;  ///< degrees; below it the sky's formulas do not hold

bool is_light_name(std::string_view word);

/// What shines on what a camera sees.
Environment make_environment(const LightWords& words, const Camera& camera, Vec3f up);

/// What a surface does with light. Its colour is the surface's own, or `color`.
struct Material {
  enum class Kind {
    kMatte,   ///< Lambert
    kGlossy,  ///< Lambert under a rough dielectric coat (GGX)
    kMetal,   ///< a rough conductor (GGX)
    kGlass,   ///< a smooth dielectric; the surface's front is its outside
  };
  Kind kind = Kind::kMatte;
  float roughness = 0.3f;  ///< of coat and metal, in [0, 1]; GGX's alpha is its square
  float ior = 1.5f;        ///< of coat and glass, to 1 outside; above 1
  std::optional<Vec3f> color{};
};

/// An endless plane that shadows fall on: transparent where it is lit as if nothing were there.
struct Ground {
  Vec3f point{}, up{0, 1, 0};
  float albedo = 0.4f;  ///< of the light that it throws back at the object
};

/// Below all of an asset.
Ground ground_below(const Asset& asset, Vec3f up);

struct PathConfig {
  std::uint32_t width = 1024, height = 1024;
  int samples = 64;      ///< paths a pixel
  double seconds = 0;    ///< above 0: stops after so long, then with fewer samples
  int max_bounces = 64;  ///< a path's vertices at most, beside roulette; 1: direct light alone
  std::uint32_t seed = 0;
  Material material{};
  std::optional<Ground> ground{};
  /// How far off the surface secondary rays start, scan units: more than the distance between the surfaces
  /// that primary and secondary rays are cast at.
  float offset = 0;
  bool denoise = false;
  /// Colours in place of the surface's own, linear light, one a hit of the primary rays.
  std::function<std::vector<Vec3f>(std::span<const Hit>)> colors{};
};

struct PathPicture {
  Image color;             ///< R G B A, premultiplied
  Image direct, indirect;  ///< R G B: light of one bounce, and of more
  Image albedo;            ///< R G B of what is seen first
  Image shadow;            ///< Y: of the direct light that would come, the part that is kept off
  int samples = 0;         ///< paths a pixel that it took
  double noise = 0;        ///< the mean standard error of pixels over their mean, before denoising
  std::uint64_t rays = 0;  ///< cast
  double trace_seconds = 0, shade_seconds = 0;
};

/// The picture of an AOV: kShaded, or one of light but kOcclusion.
Image& image_of(PathPicture& picture, Aov aov);

/// A picture by path tracing: next event estimation and multiple importance sampling (balance heuristic),
/// Russian roulette, Owen-scrambled Sobol points. Primary rays are cast at `primary`, all others at
/// `secondary`, which may be the same, or a coarser level of the same pair. Equal configurations without
/// `seconds` give equal pictures.
PathPicture trace_paths(const Tracer& primary, const Tracer& secondary, const Camera& camera,
                        const Environment& environment, const PathConfig& config,
                        const Progress& progress = {});

/// PathConfig.offset for an asset's levels (ignored where it has none): three times their stated errors where
/// they differ, and for clouds what overlapping discs lie apart.
float path_offset(const Asset& asset, const std::string& primary_level, const std::string& secondary_level);

/// Light to what a screen shows, in place: a filmic curve that keeps highlights (Narkowicz 2016, a fit to
/// ACES), exposed for a white surface in a light of radiance 1. `color`: R G B A, premultiplied.
void apply_filmic_curve(Image& color);

/// The part of the sky that each pixel's surface sees, 1 for all of it: cosine-weighted rays of length
/// `distance` (0: endless). Y, 1 where nothing is hit; of the config, size, samples, seed and offset are
/// used.
Image trace_ambient_occlusion(const Tracer& primary, const Tracer& secondary, const Camera& camera,
                              float distance, const PathConfig& config, const Progress& progress = {});

/// Light that arrives at points of a surface, on the side that their unit normals face: what a white matte
/// surface there would throw back, by config.samples paths each. Of the config, samples, max_bounces, seed,
/// material (of what light is thrown from), ground and offset are used.
std::vector<Vec3f> gather_light(const Tracer& tracer, std::span<const Vec3f> points,
                                std::span<const Vec3f> normals, const Environment& environment,
                                const PathConfig& config, const Progress& progress = {});

/// The part of the sky that points see, as trace_ambient_occlusion().
std::vector<float> gather_occlusion(const Tracer& tracer, std::span<const Vec3f> points,
                                    std::span<const Vec3f> normals, float distance, const PathConfig& config,
                                    const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
