// Values on a pair's surface: a layer read at points, painted at points, or filled with baked light.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/device.h"
#include "rbvh/light.h"
#include "rbvh/progress.h"

#pragma GCC visibility push(default)
namespace rbvh {

// Points are in inner coordinates (rbvh/frame.h). All of these throw Error(kUsage) for an asset that is no
// pair and for levels and layers that are not there.

/// Throws Error(kUsage) for what is no name of a layer.
void check_layer_name(std::string_view name);

/// The names of a level's layers beside height, normal and color; level empty: the finest.
std::vector<std::string> layer_names(const Asset& pair, const std::string& level = {});

/// A row of values for each point, NaN where there is none.
struct LayerValues {
  std::vector<float> values;
  std::size_t width = 1;  ///< of a row: 1 for "height", 3 for "normal" and "color" (sRGB in [0, 1])
};

/// `reach`: how far from the surface a point may lie, scan units; not set: 1% of the diagonal.
LayerValues sample_pair(const Device& device, const Asset& pair, const std::string& layer,
                        std::span<const Vec3f> points, const std::string& level = {},
                        std::optional<float> reach = {});

struct PaintConfig {
  std::string layer;                     ///< "color", or one of your own, made where it is not there
  std::vector<std::string> levels = {};  ///< none: all
  float radius =
      0;  ///< scan units; 0: only the texels that cover a point. Of several points the nearest counts
  std::optional<double> scale = {};  ///< of a new layer: its texels to one of the heights'
  std::optional<float> reach = {};   ///< as sample_pair()'s
};

/// Writes a row of `width` (1 to 4) values at each point; NaN takes a value away. Returns the number of
/// points that lie on no surface.
std::uint64_t paint_pair(const Device& device, const Asset& pair, std::span<const Vec3f> points,
                         std::span<const float> values, std::size_t width, const PaintConfig& config);

/// What of light a layer keeps.
enum class BakedLight {
  kOcclusion,   ///< the part of the sky that is seen: one channel
  kSky,         ///< what a white matte surface throws back of the light that comes directly: R, G, B
  kIrradiance,  ///< and of the light that other parts of the surface throw at it
};

struct BakeLayer {
  std::string name{};  ///< of the layer, a user's own; one of that name is replaced
  BakedLight light = BakedLight::kOcclusion;
  double scale = 1;    ///< its texels to one of the heights'
  float distance = 0;  ///< of kOcclusion: what lies farther is not seen; 0: all is
};

/// How many texels of a level were baked.
using BakedLevel = std::pair<std::string, std::uint64_t>;

/// Bakes the levels of these names (none: all), each by config.samples rays or paths a texel.
std::vector<BakedLevel> bake_pair(const Device& device, const Asset& pair, const BakeLayer& bake,
                                  const Environment& environment, const PathConfig& config,
                                  const std::vector<std::string>& levels = {}, const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
