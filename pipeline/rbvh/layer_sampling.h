// Reading a level's layers: at points in space, at the hits of rays.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/rbvh/point_query.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Values per point: 1 for heights (how far the tile's surface lies above the point, scan units), 3 for
/// normals (unit) and colours (sRGB in [0, 1]), else the layer's channels.
std::size_t sample_width(const Layer& layer);

/// A copy of the level's layer of that name; of "normal", where the level stores none, that of its heights.
/// Throws Error(kUsage) for any other name; `file` is for messages.
Layer layer_to_sample(const Level& level, const std::string& name, const std::string& file);

/// How far from the pair's surface a point may lie to be on it, unless told otherwise, scan units: 1% of the
/// diagonal, beyond which a hit is on another piece of surface (leaks and walls).
float default_reach(const Rbvh& rbvh);

/// Values at points, row by row; NaN where no texel has one. Bilinear in each tile that covers the point, and
/// a weighted mean of these tiles that has no seam where one ends. `most`: see covering().
std::vector<float> sample_layer(const PointIndex& index, const Level& level, const Layer& layer,
                                std::span<const Vec3f> points, float most);

/// Values at the hits of rays, from the tile that was hit alone; NaN for a miss. Not of heights.
std::vector<float> sample_layer_at_hits(const Level& level, const Layer& layer, std::span<const Hit> hits);

}  // namespace rbvh
