// Bakes a scan to a proxy: a base of few quads, and for each of their texels the vector to its point on the
// scan.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/proxy/manifold.h"
#include "pipeline/proxy/proxy.h"
#include "rbvh/progress.h"
#include "rbvh/scan.h"

namespace rbvh {

struct BakeConfig {
  std::uint64_t max_patches = 3000;  ///< 0: as few as max_error allows
  double max_error = 0;  ///< > 0: RMS distance of the base from the scan, as a fraction of the diagonal
  double detail = 6e-5;  ///< a tile with twice as many texels would move the surface by at most this (RMS),
                         ///< as a fraction of the diagonal
  std::uint32_t max_side = 129;     ///< texels a side of a tile at most: 2^k + 1
  double texels_per_triangle = 16;  ///< of the scan, at most: more would only copy its facets
  double min_component = 0.001;     ///< parts with less than this fraction of the area are left out
};

struct BakeReport {
  ManifoldCounts mesh;
  std::uint64_t triangles_in = 0, base_triangles = 0, alone_triangles = 0;
  std::uint64_t patches = 0, texels = 0;
  std::vector<std::uint64_t> patches_of_level;  ///< tiles with 2^level + 1 texels a side
  std::uint64_t patches_at_limit = 0;           ///< that max_side keeps coarser
  std::uint64_t folded_steps = 0;               ///< decimation steps parametrised on a circle
  std::uint64_t projected_texels = 0;  ///< without a counterpart on the scan: none, as the map is surjective
  double stretch_median = 0,
         stretch_p95 = 0;  ///< longest to shortest side of texels on the surface; 1: square
  double area_p95 = 0;     ///< a texel's area against its patch's mean, or the other way round; 1: all equal
  double longest_displacement = 0;  ///< scan units
  double join_seconds = 0, decimate_seconds = 0, pair_seconds = 0, sample_seconds = 0;
};

/// Throws Error(kInput) where a position is not finite or beyond what a proxy can hold. `file` is for
/// messages.
void check_bakeable(const Scan& scan, const std::string& file);

/// About how many bytes a bake has in memory at its peak.
std::uint64_t bake_memory(const Scan& scan);

/// Throws Error(kInput) for a cloud, and where nothing is left; Error(kBudget) where max_patches cannot be
/// reached. `file` is for messages. The proxy has no find_fault().
Proxy bake_proxy(const Scan& scan, const std::string& file, const BakeConfig& config, BakeReport& counts,
                 const Progress& progress = {});

}  // namespace rbvh
