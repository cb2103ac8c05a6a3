#include "pipeline/render/color_map.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/srgb.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/scan.h"
#include "rbvh/tracer.h"

namespace rbvh {
namespace {

using Coefficients = std::array<float, 7>;

// By powers of t, red, green, blue.
constexpr Coefficients kViridis[3] = {
    {0.2777273f, 0.1050930f, -0.3308618f, -4.6342305f, 6.2282699f, 4.7763850f, -5.4354559f},
    {0.0054073f, 1.4046135f, 0.2148476f, -5.7991010f, 14.1799334f, -13.7451454f, 4.6458526f},
    {0.3340998f, 1.3845902f, 0.0950952f, -19.3324410f, 56.6905526f, -65.3530326f, 26.3124352f}};
constexpr Coefficients kCividis[3] = {{-4.54f, -35.34f, 2381.73f, -6402.7f, 7024.72f, -2710.57f, 0},
                                      {32.49f, 170.73f, 52.82f, -131.46f, 176.58f, -67.37f, 0},
                                      {81.24f, 442.36f, -2482.43f, 6167.24f, -6614.94f, 2475.67f, 0}};
constexpr Coefficients kTurbo[3] = {{34.61f, 1172.33f, -10793.56f, 33300.12f, -38394.49f, 14825.05f, 0},
                                    {23.31f, 557.33f, 1225.33f, -3574.96f, 1073.77f, 707.56f, 0},
                                    {27.2f, 3211.1f, -15327.97f, 27814.f, -22569.18f, 6838.66f, 0}};

float polynomial(const Coefficients& c, float t) {
  float value = 0;
  for (auto i = c.rbegin(); i != c.rend(); ++i) value = value * t + *i;
  return value;
}

ValueRange range_of(std::span<const float> values) {
  ValueRange range{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  for (const float value : values)
    if (std::isfinite(value)) range = {std::min(range.lo, value), std::max(range.hi, value)};
  return range.lo <= range.hi ? range : ValueRange{};
}

float share(float value, ValueRange range) {
  return range.hi > range.lo ? std::clamp((value - range.lo) / (range.hi - range.lo), 0.f, 1.f) : 0;
}

std::vector<Vec3f> colors_of(std::span<const float> values, std::size_t width, ColorMap map,
                             ValueRange range) {
  std::vector<Vec3f> colors(values.size() / width, kClay);
  parallel_for(colors.size(), 1 << 14, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const float* v = values.data() + i * width;
      if (std::isnan(v[0])) continue;
      if (width >= 3) {
        colors[i] = {share(v[0], range), share(v[1], range), share(v[2], range)};
        continue;
      }
      const Vec3f shown = map_color(map, share(v[0], range));
      colors[i] = {srgb_to_linear(shown.x), srgb_to_linear(shown.y), srgb_to_linear(shown.z)};
    }
  });
  return colors;
}

/// A vertex property where a mesh or cloud was hit.
std::vector<float> values_at(const Scan& scan, const std::vector<float>& values, std::span<const Hit> hits) {
  std::vector<float> at(hits.size(), std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const Hit& hit = hits[i];
    if (hit.leaf == RBVH_NO_LEAF) continue;
    if (scan.is_cloud()) {
      at[i] = values[hit.leaf];
      continue;
    }
    const Triangle& corners = scan.triangles[hit.leaf];
    at[i] =
        values[corners[0]] * (1 - hit.u - hit.v) + values[corners[1]] * hit.u + values[corners[2]] * hit.v;
  }
  return at;
}

}  // namespace

Vec3f map_color(ColorMap map, float t) {
  t = std::clamp(t, 0.f, 1.f);
  const auto& c = map == ColorMap::kViridis ? kViridis : map == ColorMap::kCividis ? kCividis : kTurbo;
  const float scale = map == ColorMap::kViridis ? 1 : 1.f / 255;
  Vec3f color;
  for (int i = 0; i < 3; ++i)
    color[i] = std::clamp(polynomial(c[static_cast<std::size_t>(i)], t) * scale, 0.f, 1.f);
  return color;
}

std::optional<Vec3f> parse_color(std::string_view text) {
  if (text == "white") return Vec3f{1, 1, 1};
  if (text == "black") return Vec3f{0, 0, 0};
  if (text == "grey" || text == "gray") return Vec3f{0.5f, 0.5f, 0.5f};
  Vec3f color;
  if (text.starts_with('#') && text.size() == 7) {
    const char* begin = text.data() + 1;
    for (int c = 0; c < 3; ++c, begin += 2) {
      unsigned value = 0;
      if (std::from_chars(begin, begin + 2, value, 16).ptr != begin + 2) return std::nullopt;
      color[c] = static_cast<float>(value) / 255;
    }
    return color;
  }
  const char* at = text.data();
  const char* const end = at + text.size();
  for (int c = 0; c < 3; ++c) {
    const auto [stop, code] = std::from_chars(at, end, color[c]);
    if (code != std::errc() || !(color[c] >= 0 && color[c] <= 1)) return std::nullopt;
    if (c < 2 ? stop == end || *stop != ',' : stop != end) return std::nullopt;
    at = stop + 1;
  }
  return color;
}

ValueColors value_colors(const Asset& asset, const std::string& level, const ColoredValues& of) {
  if (const Scan* scan = asset.scan()) {
    for (const ScalarProperty& property : scan->properties) {
      if (property.name != of.name) continue;
      const ValueRange range = of.range.value_or(range_of(property.values));
      return {[scan, &property, range, map = of.map](std::span<const Hit> hits) {
                return colors_of(values_at(*scan, property.values, hits), 1, map, range);
              },
              range};
    }
    throw Error(ErrorKind::kUsage, asset.path, "there is no vertex property '" + of.name + "'");
  }
  const Level* colored = asset.rbvh() ? asset.rbvh()->find_level(level) : nullptr;
  const Layer* layer = colored ? find_layer(*colored, of.name) : nullptr;
  if (!layer || layer_kind(of.name) != LayerKind::kUser)
    throw Error(ErrorKind::kUsage, asset.path, "there is no layer '" + of.name + "' of your own in " + level);
  const ValueRange range = of.range.value_or(ValueRange{layer->lo, layer->hi});
  return {[colored, layer, range, map = of.map](std::span<const Hit> hits) {
            return colors_of(sample_layer_at_hits(*colored, *layer, hits), sample_width(*layer), map, range);
          },
          range};
}

}  // namespace rbvh
