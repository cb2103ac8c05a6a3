// Scans made of scans, the same ones every run: finer meshes, noisy ones, clouds. What the benchmarks need
// and no archive has.
#pragma once

#include <cstddef>
#include <cstdint>

#include "rbvh/scan.h"

namespace rbvh {

/// One step of Loop's subdivision (1987): four times the triangles, on a smoother surface. Edges of one or of
/// more than two triangles are creases. The result has positions and triangles only.
Scan loop_subdivided(const Scan& mesh);

/// Of all triangles' edges.
double mean_edge(const Scan& mesh);

/// Moves every vertex along its normal by a Gaussian of standard deviation `sigma` (scan units), each by its
/// own.
void add_noise(Scan& scan, double sigma, std::uint64_t seed);

/// `count` points, independent of each other and evenly spread by area, with the normals of their triangles.
Scan sample_points(const Scan& mesh, std::size_t count, std::uint64_t seed);

}  // namespace rbvh
