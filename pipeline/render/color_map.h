// Colours for values: perceptual maps, over a range.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/ray.h"

namespace rbvh {

enum class ColorMap { kViridis, kCividis, kTurbo };
inline constexpr std::pair<std::string_view, ColorMap> kColorMaps[] = {
    {"viridis", ColorMap::kViridis}, {"cividis", ColorMap::kCividis}, {"turbo", ColorMap::kTurbo}};

/// sRGB of "white", "black", "grey", "#rrggbb" or "r,g,b" (each 0 to 1); or nothing for any other text.
std::optional<Vec3f> parse_color(std::string_view text);

struct ValueRange {
  float lo = 0, hi = 0;
};

/// The colour of t in [0, 1], sRGB. Fits by Zucker (viridis), Bostock (cividis, turbo, in
/// d3-scale-chromatic), within 0.01 of the maps (turbo: of Mikhailov 2019; cividis: of Nunez et al. 2018).
Vec3f map_color(ColorMap map, float t);

/// How values become colours.
struct ColoredValues {
  std::string name;  ///< of a pair's layer, or of a scan's vertex property
  ColorMap map = ColorMap::kViridis;
  std::optional<ValueRange> range{};  ///< unless given, that of the values
};

struct ValueColors {
  /// RenderConfig.colors: linear light; clay where there is no value.
  std::function<std::vector<Vec3f>(std::span<const Hit>)> colors{};
  std::optional<ValueRange> range{};
};

/// Of the level of a pair or of a scan, which must outlive the result. A layer of three channels is red,
/// green and blue. Throws Error(kUsage) where there is no such layer of the user's own, or vertex property.
ValueColors value_colors(const Asset& asset, const std::string& level, const ColoredValues& of);

}  // namespace rbvh
