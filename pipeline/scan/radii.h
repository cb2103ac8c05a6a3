// The radii of a cloud's discs that leave no hole, and the area that the discs represent.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/scan/neighbors.h"
#include "pipeline/scan/scan.h"

namespace rbvh {

/// Radii that let the discs cover the surface wherever its points are not further apart than a few times
/// their usual spacing, and are no larger than that takes. Positive wherever two points differ. Needs finite
/// points and normals.
std::vector<float> estimate_radii(std::span<const Vec3f> points, std::span<const Vec3f> normals,
                                  const Neighbors& neighbors);

/// Scan units squared: the triangles' area, or the sum of the squared spacings of a cloud's points. A point's
/// spacing squared is the part of its disc that is nearer to it than to its neighbours, measured at 20,000
/// points spread over the cloud, so that overlapping discs count once. Elements that are not finite and discs
/// without a radius count nothing.
double surface_area(const Scan& scan);

/// The factor from the discs' radii to spacings whose squares sum up to the surface_area():
/// about 1.3 on a square grid, 0.9 among points strewn at random. 1 without discs.
double spacing_per_radius(const Scan& scan);

}  // namespace rbvh
