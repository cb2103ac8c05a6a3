// A level of a pair as a scan: for programs that know no pairs.
#pragma once

#include <cstdint>
#include <string>

#include "rbvh/asset.h"
#include "rbvh/scan.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// What became of a level's tiles, and what stays open. All 0 for a cloud.
struct LevelMeshCounts {
  std::uint64_t tile_quads = 0;            ///< of neighbouring tiles, which overlap
  std::uint64_t trimmed_quads = 0;         ///< of those: lay on a neighbour and went
  std::uint64_t primitive_triangles = 0;   ///< of leaves without a tile, as they are
  std::uint64_t welded_vertices = 0;       ///< moved to one of a neighbour
  std::uint64_t stitch_triangles = 0;      ///< that close the gaps between tiles
  std::uint64_t primitive_open_edges = 0;  ///< with one triangle, among the primitives alone
  std::uint64_t open_edges = 0;            ///< with one triangle: where the scan ends, or a gap stayed open
  std::uint64_t non_manifold_edges = 0;    ///< with more than two triangles, or two that face different ways
};

/// The pair's level of that name, the finest for an empty one, with normals and, where the pair has them,
/// colours or a texture (of which the image's file is not made): triangles with shared vertices, closed where
/// the level's surface is, up to the edges counted in `counts`; of a cloud points with radii. Deterministic.
/// Throws Error(kUsage) for an asset that is no pair and for a level that is not there, Error(kInput) for a
/// level without a surface.
Scan level_mesh(const Asset& pair, const std::string& level = {}, LevelMeshCounts* counts = nullptr);

}  // namespace rbvh
#pragma GCC visibility pop
