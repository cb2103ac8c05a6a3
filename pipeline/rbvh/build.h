// From a scan to a rasterized BVH: partition, tiles, atlas, one full rebuild per level.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/focus.h"
#include "pipeline/rbvh/partition.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

enum class Refinement { kProjectedArea, kConeOfNormals };

/// What the pair will be cast with most: sets the best side of a tile (section 3.4 of the paper).
enum class RaysKind { kCoherent, kIncoherent };

/// That side in texels: 5.76 ln rho - 42.99 for coherent rays, 1.23 ln rho - 0.17 for incoherent ones, at
/// least 8. A node also splits while its tile would be larger.
float optimal_resolution(float rho, RaysKind rays);

/// Which leaves keep their primitives and are traced exactly. kOff: none. kAuto: of few primitives, where the
/// tile would be faulty or the primitives are the fewer bytes. kAlways: all; tiles are split until all can.
enum class Hybrid { kOff, kAuto, kAlways };

struct BuildConfig {
  std::vector<LevelConfig> levels = standard_levels();
  Refinement refinement = Refinement::kProjectedArea;
  SplitRule split = SplitRule::kSpatialMedian;
  PartitionWhere partition = PartitionWhere::kDevice;
  RaysKind rays = RaysKind::kCoherent;
  std::optional<Focus> focus = std::nullopt;
  float tile_side = 0;  ///< the largest of a tile, texels; 0: optimal_resolution()
  double area = 0;      ///< that the levels' rho is for; 0: the scan's own
  Hybrid hybrid = Hybrid::kAuto;
};

/// What a build did, for reports: seconds by phase, summed over levels.
struct BuildTimings {
  double upload = 0, partition = 0, rasterize = 0, pack = 0;
  struct PerLevel {
    std::string name;
    double seconds = 0;
  };
  std::vector<PerLevel> levels;
};

/// The scan must have finite positions only; a cloud needs normals and radii. Deterministic for one device.
Rbvh build_rbvh(const Device& device, const Scan& scan, const BuildConfig& config,
                const Progress& progress = {}, BuildTimings* timings = nullptr);

}  // namespace rbvh
