// Each point's nearest neighbours, by FLANN's kd-tree: normals, orientation, disc radii and outliers are
// computed from them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/base/vec.h"

namespace rbvh {

/// Indices of other points, nearest first, for each point. Neighbours of i: indices[offsets[i]] to
/// indices[offsets[i + 1]].
struct Neighbors {
  std::vector<std::uint64_t> offsets;
  std::vector<std::uint32_t> indices;

  std::size_t size() const { return offsets.empty() ? 0 : offsets.size() - 1; }
  std::span<const std::uint32_t> of(std::size_t point) const {
    return {indices.data() + offsets[point], static_cast<std::size_t>(offsets[point + 1] - offsets[point])};
  }
};

/// The k nearest of each point (all others, where there are fewer). Where those lie along a line or fill a
/// volume, twice or four times as many, so that they span a surface: scanners sample one direction far denser
/// than the other, quantise depth into layers, and see into trees. Only every `step`-th point is queried;
/// the others get none. All positions must be finite. Up to 16 k bytes a point. The same for any number of
/// threads.
Neighbors find_neighbors(std::span<const Vec3f> points, std::size_t k, const Progress& progress = {},
                         std::size_t step = 1);

}  // namespace rbvh
