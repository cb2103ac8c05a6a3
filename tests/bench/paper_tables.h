// The figures of Novak and Dachsbacher, "Rasterized Bounding Volume Hierarchies" (2012), tables 1 to 4:
// GeForce GTX 470, CPU builds on one core of a 2.8 GHz Core i7; megabytes and milliseconds.
#pragma once

#include <array>
#include <cmath>
#include <iterator>

namespace rbvh::bench {

struct PaperSplits {
  const char* scene;
  double triangles;
  struct Row {
    double nodes, seconds, mrays;
  } median, sah;
};
inline constexpr PaperSplits kPaperTable1[] = {
    {"Dragon", 0.699e6, {2999, 0.9, 146.3}, {2674, 26.8, 161.3}},
    {"Happy Buddha", 1.37e6, {8065, 1.8, 138.1}, {3266, 50.6, 169.3}},
    {"Beast", 2.82e6, {7639, 3.5, 109.6}, {4696, 118.1, 140.5}},
    {"Asian Dragon", 7.22e6, {6345, 5.9, 159.9}, {5227, 173.0, 180.2}},
};

struct PaperRates {
  const char* scene;
  double triangles;
  double primary_bvh;
  std::array<double, 5> primary;  ///< Q0 to Q4
  double diffuse_bvh;
  std::array<double, 5> diffuse;
};
inline constexpr PaperRates kPaperTable2[] = {
    {"Hand", 0.655e6, 178.7, {145.3, 176.6, 209.9, 266.0, 300.0}, 55.9, {32.5, 37.1, 44.3, 56.6, 69.1}},
    {"Dragon", 0.699e6, 137.2, {111.6, 139.8, 169.4, 229.4, 287.2}, 38.2, {20.7, 21.7, 27.6, 38.7, 53.3}},
    {"Happy Buddha",
     1.37e6,
     144.6,
     {147.5, 183.9, 226.2, 307.2, 386.4},
     37.2,
     {21.7, 24.9, 30.5, 41.4, 54.6}},
    {"Children", 1.45e6, 123.2, {121.2, 148.8, 177.6, 232.2, 282.8}, 36.1, {21.2, 23.6, 28.1, 39.1, 51.0}},
    {"Beast", 2.82e6, 120.4, {131.9, 163.1, 195.4, 256.0, 298.3}, 37.8, {20.7, 23.3, 27.8, 37.9, 47.4}},
    {"Asian Dragon", 7.22e6, 85.9, {158.5, 190.2, 216.1, 263.7, 304.4}, 36.7, {29.4, 31.9, 35.1, 43.7, 53.9}},
    {"Thai Statue", 10.0e6, 122.9, {197.4, 250.5, 302.7, 375.4, 454.6}, 32.9, {30.7, 35.5, 41.9, 51.7, 59.9}},
};

struct PaperMemory {
  const char* scene;
  double triangles;
  double bvh_tree, bvh_triangles;
  double q0_tree, q0_atlas, q2, q4;
};
inline constexpr PaperMemory kPaperTable3[] = {
    {"Dragon", 0.699e6, 14.5, 12.0, 0.65, 15.2, 3.86, 0.38},
    {"Happy Buddha", 1.37e6, 25.5, 23.5, 1.04, 15.9, 4.13, 0.40},
    {"Asian Dragon", 7.22e6, 153.0, 123.9, 0.90, 12.2, 3.43, 0.40},
    {"Thai Statue", 10.0e6, 204.4, 171.1, 2.29, 14.3, 4.21, 0.56},
};

struct PaperBuilds {
  const char* scene;
  double triangles;
  std::array<double, 3> cpu, gpu;  ///< Q0, Q2, Q4
};
inline constexpr PaperBuilds kPaperTable4[] = {
    {"Dragon", 0.699e6, {663, 530, 431}, {121, 101, 82}},
    {"Happy Buddha", 1.37e6, {1160, 901, 704}, {182, 152, 120}},
    {"Beast", 2.82e6, {2395, 1758, 1472}, {330, 281, 239}},
};

/// The scene whose size is nearest.
template <class Row, std::size_t N>
const Row& nearest_scene(const Row (&rows)[N], std::size_t primitives) {
  const Row* best = rows;
  const auto apart = [&](const Row& row) {
    return std::abs(std::log(row.triangles / static_cast<double>(primitives == 0 ? 1 : primitives)));
  };
  for (const Row& row : rows)
    if (apart(row) < apart(*best)) best = &row;
  return *best;
}

}  // namespace rbvh::bench
