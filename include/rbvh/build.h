// From a scan to a rasterized BVH. Novak & Dachsbacher, "Rasterized Bounding Volume Hierarchies",
// Eurographics 2012.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/device.h"
#include "rbvh/progress.h"
#include "rbvh/scan.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// One quality level's parameters (the paper's table 2).
struct LevelConfig {
  std::string name;
  float rho;          ///< texels for the whole surface
  float alpha;        ///< least projected area over area
  float phi_degrees;  ///< widest half-angle of the cone of normals
  float error =
      0;  ///< between its surface and the scan's, rms, of the scan's diagonal; 0: the density alone decides
};

/// Q0 (finest) to Q4.
const std::vector<LevelConfig>& standard_levels();

/// Those of these names (empty: all), finest first in whatever order they are named. Throws Error(kUsage).
std::vector<LevelConfig> standard_levels(const std::vector<std::string>& names);

/// The finest error that a level may be built for, of the scan's diagonal: float coordinates hold no finer
/// ones; and the coarsest, where nothing is left of a shape.
inline constexpr double kFinestError = 1e-6, kCoarsestError = 0.1;

/// A level of any error, of the scan's diagonal. Its other parameters follow from the standard levels':
/// between two of them log(rho), alpha and phi are linear in log(error); beyond Q0 and Q4 alpha and phi stay,
/// and rho goes on as 1 / error (to 32 million texels, and to 192). Its name is that of the standard level
/// whose error is nearest (the smallest ratio; of equally near ones the finer). Throws Error(kUsage) for an
/// error that is not kFinestError to kCoarsestError.
LevelConfig level_of_error(double error);

/// A level by its name, with an error of its own.
struct WantedLevel {
  std::string name;
  std::optional<double> error;  ///< of the scan's diagonal; none: the standard one
};

/// Standard levels, some with errors of their own (level_of_error()), finest first in whatever order they are
/// named; none wanted: all. Throws Error(kUsage) as the above, also where a level is wanted with two errors,
/// or with one that is not coarser than that of the finer level before it.
std::vector<LevelConfig> wanted_levels(const std::vector<WantedLevel>& wanted);

/// The same without their errors: the paper's rule alone decides, and all comes from the scan's own
/// primitives.
std::vector<LevelConfig> by_density(std::vector<LevelConfig> levels);

/// Quality that varies over the scan (section 3.5 of the paper).
struct Focus {
  Vec3f center{};
  float radius = 0;   ///< within it the quality is `level`'s; scan units, > 0
  LevelConfig level;  ///< levels finer than this one are not changed
};

enum class Refinement { kProjectedArea, kConeOfNormals };

/// The rays that the pair is mostly traced with: they set the best side of a tile (section 3.4 of the paper).
enum class RaysKind { kCoherent, kIncoherent };

/// Which leaves hold primitives. kOff: none. kAuto: leaves of few primitives, where a height
/// field is a poor fit or takes more bytes. kAlways: all; nodes are split until every leaf has few enough.
enum class Hybrid { kOff, kAuto, kAlways };

enum class SplitRule {
  kSpatialMedian,  ///< the middle of the longest axis
  kSurfaceArea,    ///< the least of equation 1, S(b) A(b) + S(c) A(c), among 32 planes along each axis
};

enum class PartitionWhere { kDevice, kHost };

struct BuildConfig {
  std::vector<LevelConfig> levels = standard_levels();
  Refinement refinement = Refinement::kProjectedArea;
  SplitRule split = SplitRule::kSpatialMedian;
  PartitionWhere partition = PartitionWhere::kDevice;
  RaysKind rays = RaysKind::kCoherent;
  std::optional<Focus> focus = std::nullopt;
  double area = 0;  ///< the surface area that the levels' rho is for, scan units squared; 0: the scan's own
  Hybrid hybrid = Hybrid::kAuto;
  /// Of a textured mesh: texels of the layer `texture` to one of the heights', 1/16 to 16; not set: 2, but no
  /// more than the images have.
  std::optional<double> color_scale = std::nullopt;
};

/// For reports: seconds by phase, summed over levels, of which some are made at once.
struct BuildTimings {
  double simplify = 0, upload = 0, partition = 0, rasterize = 0, pack = 0;
  struct PerLevel {
    std::string name;
    double seconds = 0;
  };
  std::vector<PerLevel> levels;
};

/// Builds a pair in memory: an asset to trace, or to save. The scan must have finite positions only; a cloud
/// needs normals and radii. Same scan, configuration and device: same result. Throws Error(kInput) for a scan
/// whose area is zero or beyond what float can work with, Error(kBudget) where a level needs too many texels.
Asset build_pair(const Device& device, const Scan& scan, const BuildConfig& config = {},
                 const Progress& progress = {}, BuildTimings* timings = nullptr);

}  // namespace rbvh
#pragma GCC visibility pop
