// Builds a scan that is a part of a larger one, so that what is built of all parts meets.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/rbvh/build.h"

namespace rbvh {

/// What holds for a level that is there already, and so for what is added to it.
struct JoinedLevel {
  Lattice lattice;
  LeafGrid grid;
  bool holds_primitives = false;  ///< all its leaves
};

/// A scan that is a part of a larger one.
struct ScanPart {
  Bounds3f box;     ///< of the whole scan: errors are parts of its diagonal, and lattices begin at its corner
  double area = 0;  ///< of the whole scan, that rho is for; scan units squared
  std::uint64_t vertices = 0, triangles = 0;  ///< of the whole scan
  /// The scan's first ones; those behind them belong to neighbouring parts, and show how the surface goes on.
  std::uint32_t own_vertices = 0, own_primitives = 0;
  std::vector<std::uint8_t> stays;  ///< of each own vertex of a mesh whether triangles of others meet it (1)
  std::vector<JoinedLevel> joined = {};  ///< of each level of the pair that the part is added to; or empty
  bool one_sided = false;                ///< BuildTuning's
};

/// The widest texel of levels of tiles, in scan units; 0: all levels hold primitives. Of `whole` only what
/// concerns the whole scan is used.
float widest_texel(const ScanPart& whole, const BuildConfig& config);

/// As build_rbvh(), of the part's own primitives. What is built of all parts meets between them: triangles
/// keep the vertices that they share with others, tiles go on over their neighbours. A focus only where the
/// part is added to a pair. The result names the whole scan as its source.
Rbvh build_part(const Device& device, Scan&& scan, const ScanPart& part, const BuildConfig& config,
                const Progress& progress = {}, BuildTimings* timings = nullptr);

/// build_memory() of a scan with so many of them.
std::uint64_t build_memory(std::uint64_t vertices, std::uint64_t primitives, const BuildConfig& config);

}  // namespace rbvh
