// From points in space to the tiles that cover them (section 5 of the paper), for reading and writing a
// level's layers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// A level on the device, for point queries.
struct PointIndex {
  Device device;
  Buffer<RbvhNode> nodes;  ///< boxes grown so that they contain the tiles' borders
  Buffer<RbvhLeaf> leaves;
  Buffer<std::uint16_t> heights;
  Buffer<std::uint32_t> first_primitives;
  Buffer<RbvhPrimitive> primitives;
  std::uint32_t atlas_width = 0;
  std::uint32_t discs = 0;
};

PointIndex make_point_index(const Device& device, const Level& level);

/// Point i's are hits[firsts[i]] to hits[firsts[i + 1] - 1].
struct PointHits {
  std::vector<std::size_t> firsts = {0};
  std::vector<PointHit> hits;

  std::size_t points() const { return firsts.size() - 1; }
  std::span<const PointHit> of(std::size_t point) const {
    return {hits.data() + firsts[point], firsts[point + 1] - firsts[point]};
  }
};

/// Every leaf whose tile covers a point, however far above or below its surface it lies in the leaf's box;
/// with a radius (scan units) also every leaf within that. A point that is not finite has none.
PointHits query_points(const PointIndex& index, std::span<const Vec3f> points, float radius = 0);

/// A leaf that covers a point, and its weight in the mean of several: it falls to 0 where a tile's texels end
/// and where its surface is farther than another's, so that values do not jump from tile to tile.
struct Covering {
  std::uint32_t leaf = 0;
  float u = 0, v = 0, distance = 0, weight = 0;
};

/// Those of one point's hits that lie within `most` (scan units, or 4 texels if that is more) of their
/// surface and within half a texel of the nearest. Any point on the surface has one.
std::vector<Covering> covering(const Level& level, std::span<const PointHit> hits, float most);

}  // namespace rbvh
