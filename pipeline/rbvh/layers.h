// A level's layers: made of a scan's vertex properties, painted at points, read at points.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/point_query.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// "height", "normal" and "color": what their texels mean is the format's, not the user's.
bool is_standard_layer(std::string_view name);

/// A layer of no values yet, `scale` of its texels to one of the heights'. Throws Error(kBudget) where its
/// atlas would be over 65535 texels wide or high.
Layer make_layer(const Level& level, const std::string& name, std::uint32_t channels, double scale);

/// The layer's texels that lie on the surface: where in `texels` (by pixel, not channel), and their points.
struct LayerPoints {
  std::vector<std::size_t> texels;
  std::vector<Vec3f> points;
};
LayerPoints layer_points(const Level& level, const Layer& layer);

/// The property at the scan's nearest point: interpolated in a triangle, of a cloud the nearest point's.
std::vector<float> property_at(const Scan& scan, const ScalarProperty& property,
                               std::span<const Vec3f> points);

/// Sets all texels of one channel that are named; NaN: no value. The range is grown to hold the values, and
/// what was there is kept to half a step of the larger range. Throws Error(kInput) where that overflows.
void set_values(Layer& layer, std::span<const std::size_t> texels, std::span<const float> values);

/// Adds each property as a layer of each level (replacing one of that name). Throws Error(kUsage) for a name
/// that the scan does not have or that no layer can have.
void add_property_layers(std::vector<Level>& levels, const Scan& scan, const std::vector<std::string>& names,
                         double scale, const Progress& progress = {});

/// What reads give: 1 value for "height" (how far the tile's surface lies above the point, scan units), 3 for
/// "normal" (unit) and "color" (sRGB in [0, 1]), else the layer's channels.
std::size_t sample_width(const Layer& layer);

/// Values at points, row by row, NaN where no texel has one: of each covering tile bilinear between its
/// texels, of several a mean that has no seam where one ends. `most`: see covering().
std::vector<float> sample_layer(const PointIndex& index, const Level& level, const Layer& layer,
                                std::span<const Vec3f> points, float most);

/// The same at the places that rays hit, from the tile that was hit alone; a miss is NaN.
std::vector<float> sample_layer_at_hits(const Level& level, const Layer& layer, std::span<const Hit> hits);

struct PaintCounts {
  std::uint64_t points_missed = 0;  ///< that lie on no surface
  std::uint64_t texels = 0;         ///< written
};

/// Writes values (sample_width() each; NaN in the first: takes the value away) to every texel, of every tile,
/// that covers a point or whose place on the surface is within `radius` of one; of several points the
/// nearest, of equally near ones the last. The layer is "color" or one of the user's own.
PaintCounts paint_layer(const PointIndex& index, const Level& level, Layer& layer,
                        std::span<const Vec3f> points, std::span<const float> values, float radius,
                        float most);

}  // namespace rbvh
