// Gaussian splats (Kerbl et al. 2023, "3D Gaussian Splatting for Real-Time Radiance Field Rendering"), as
// their training writes them to PLY, as a cloud of oriented discs.
#pragma once

#include "rbvh/scan.h"

namespace rbvh {

/// The cloud's vertex properties are those of splats: f_dc_0 to 2, opacity, scale_0 to 2, rot_0 to 3.
bool is_splats(const RawScan& cloud);

/// Each splat of an opacity above one half becomes a disc. Its normal is the splat's shortest axis, turned
/// away from the cloud's middle; its radius is 1.5 standard deviations, the geometric mean of the other two
/// axes'; its colour is that of harmonic degree 0, without dependence on the view. The splats' own properties
/// go. What is left out is noted. Throws Error(kInput) where nothing is left; `file` is for messages.
void splats_to_discs(RawScan& cloud, const std::string& file);

}  // namespace rbvh
