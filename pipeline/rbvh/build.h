// From a scan to a rasterized BVH: partition, tiles, atlas, one full rebuild per level.
#pragma once

#include <string>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/device/device.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// One quality level's parameters (the paper's table 2).
struct LevelConfig {
  std::string name;
  float rho;          ///< texels per unit of normalised area
  float alpha;        ///< least projected area over area
  float phi_degrees;  ///< widest half-angle of the cone of normals
};

/// Q0 (finest) to Q4.
const std::vector<LevelConfig>& standard_levels();

enum class Refinement { kProjectedArea, kConeOfNormals };

/// Which leaves keep their primitives and are traced exactly. kOff: none. kAuto: of few primitives, where the
/// tile would be faulty or the primitives are the fewer bytes. kAlways: all; tiles are split until all can.
enum class Hybrid { kOff, kAuto, kAlways };

struct BuildConfig {
  std::vector<LevelConfig> levels = standard_levels();
  Refinement refinement = Refinement::kProjectedArea;
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
