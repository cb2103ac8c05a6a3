// Small pictures that a view is chosen by.
#pragma once

#include <string>
#include <vector>

#include "pipeline/trace/camera_rays.h"
#include "rbvh/asset.h"
#include "rbvh/tracer.h"

namespace rbvh {

struct SmallPicture {
  CameraRays rays;
  std::vector<Hit> hits;
};

/// From far away, all of the bounding sphere in the frame: pixels of all pictures of an asset are equally
/// large. `from`: towards the camera.
SmallPicture small_picture(const Tracer& tracer, const Asset& asset, Vec3d from, Vec3d up);

/// What is up: the asset's own axis, unless its surface has a larger level plane along another one, of which
/// `text` then tells.
Vec3d find_up(const Tracer& tracer, const Asset& asset, std::string& text);

}  // namespace rbvh
