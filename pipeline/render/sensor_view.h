// The view of the sensor that a cloud was seen by.
#pragma once

#include <optional>
#include <span>

#include "pipeline/render/small_pictures.h"
#include "rbvh/view.h"

namespace rbvh {

/// From the viewpoint that the file names or, where it names none, from the origin of its coordinates, if
/// that sees all of the surface. `pictures` are of the surface from around it. None where the asset is no
/// cloud, has several viewpoints, or reaches further around the sensor than a picture can.
std::optional<ChosenView> sensor_view(const Tracer& tracer, const Asset& asset,
                                      std::span<const SmallPicture> pictures, std::optional<Vec3d> up,
                                      double aspect);

}  // namespace rbvh
