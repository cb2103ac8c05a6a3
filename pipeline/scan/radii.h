// How large the discs of a cloud must be to leave no hole, and what area they stand for.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/scan/neighbors.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// A disc of radius r stands for a square of side r / kRadiusPerSpacing, the local spacing of the points:
/// discs at the corners of a square grid just meet in its middle at 0.707 of its side; the rest is overlap
/// against tilt and noise.
inline constexpr double kRadiusPerSpacing = 0.8;

/// The area that a disc stands for, scan units squared. Smaller than the disc's own: discs overlap.
inline double disc_area(float radius) {
  const double spacing = static_cast<double>(radius) / kRadiusPerSpacing;
  return spacing * spacing;
}

/// Radii that let the discs cover the surface wherever its points are not further apart than a few times
/// their usual spacing, and are no larger than that takes. Positive wherever two points differ. Needs finite
/// points and normals.
std::vector<float> estimate_radii(std::span<const Vec3f> points, std::span<const Vec3f> normals,
                                  const Neighbors& neighbors);

/// Scan units squared: the triangles' area, or the sum of the squared spacings of a cloud's discs (0 without
/// radii). Elements with non-finite positions count nothing.
double surface_area(const Scan& scan);

}  // namespace rbvh
