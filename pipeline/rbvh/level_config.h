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

}  // namespace rbvh
