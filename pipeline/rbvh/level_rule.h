// A level's parameters applied to nodes of the partition.
#pragma once

#include <optional>

#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/partition.h"

namespace rbvh {

struct LevelRule {
  LevelConfig level;
  const BuildConfig* config = nullptr;
  float area = 1;                 ///< that rho is for, scan units squared
  float largest_tile = 0;         ///< side in texels; 0: optimal_resolution()
  bool one_sided = false;         ///< BuildTuning's
  float error = 0;                ///< the level's, scan units; 0: its density alone decides
  bool holds_primitives = false;  ///< all its leaves
  Lattice lattice;                ///< of its primitives
  std::optional<LeafGrid> grid;   ///< of its frames and boxes; not set: as the scan's bounds ask for
};

/// Texels per scan unit squared that the level asks for at the node.
float texels_per_area(const LevelRule& rule, const PartitionNode& node);

/// Whether the level splits the node before anything is rasterised.
bool wants_split(const LevelRule& rule, const PartitionNode& node);

}  // namespace rbvh
