// Camera files: {"cameras": [{"position": [x, y, z], "focal_point": [x, y, z], "view_up": [x, y, z],
// "view_angle": degrees, "azimuth_angle": degrees, "elevation_angle": degrees}, ...]}, or the list alone.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/render/camera.h"

namespace rbvh {

/// The cameras in their order, at least one; what one leaves out is taken from `defaults`. Throws
/// Error(kInput), naming `path` and the place of the first fault.
std::vector<CameraWords> decode_cameras(std::string_view text, const std::string& path,
                                        const CameraWords& defaults);
std::vector<CameraWords> read_cameras(const std::string& path, const CameraWords& defaults);

}  // namespace rbvh
