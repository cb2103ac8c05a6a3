// Writing values to a level's layers at points in space.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/rbvh/point_query.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Values at points, and how they are painted.
struct PointPaint {
  std::string layer;  ///< "color", or a user's own
  std::span<const Vec3f> points;
  std::span<const float> values;  ///< `width` for each point
  std::size_t width = 0;
  std::optional<double> scale = {};  ///< make_layer()'s, of a layer that is not there yet; not set: 1
  float radius = 0;                  ///< see paint_layer()
  std::optional<float> reach = {};   ///< see covering(); not set: default_reach()
};

struct PaintCounts {
  std::uint64_t points_missed = 0;  ///< that lie on no surface
  std::uint64_t texels = 0;         ///< written
};

/// The level's layer of that name with so many values a point, made with `scale` (make_layer()) where it is
/// not there. Throws Error(kUsage) where it has another number of values, and where a level without colours
/// is to be painted with them; `file` is for messages.
Layer& layer_to_paint(Level& level, const std::string& name, std::size_t width, double scale,
                      const std::string& file);

/// Writes values (sample_width() each; NaN in the first: removes the value) to every texel, of every tile,
/// that covers a point or whose place on the surface is within `radius` (scan units) of one; of several
/// points the nearest is written, of equally near ones the last. The layer is "color" or a user's own.
/// `most`: see covering().
PaintCounts paint_layer(const PointIndex& index, Level& level, Layer& layer, std::span<const Vec3f> points,
                        std::span<const float> values, float radius, float most);

/// Paints the pair's levels of these names; the counts of each, in the pair's order. Throws as
/// layer_to_paint(), and Error(kUsage) where a scale is given for a layer that is there.
std::vector<std::pair<std::string, PaintCounts>> paint_levels(const Device& device, Rbvh& rbvh,
                                                              const std::vector<std::string>& levels,
                                                              const PointPaint& paint,
                                                              const std::string& file);

}  // namespace rbvh
