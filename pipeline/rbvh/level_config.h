// A quality level's parameters.
#pragma once

#include <string>
#include <vector>

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

/// Those of these names (empty: all), finest first in whatever order they are named. Throws Error(kUsage).
std::vector<LevelConfig> standard_levels(const std::vector<std::string>& names);

}  // namespace rbvh
