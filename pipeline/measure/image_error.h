// How different two pictures look: RMSE, PSNR and SSIM (Wang, Bovik, Sheikh, Simoncelli, "Image quality
// assessment: from error visibility to structural similarity", 2004).
#pragma once

#include "rbvh/image.h"
#include "rbvh/measure.h"

namespace rbvh {

/// Both R G B A of kind kColor and one size, laid over mid grey and compared as an 8-bit picture would show
/// them: what is brighter than white is white, NaN is black. Means are over the pixels that either picture
/// covers; two empty pictures are equal.
ImageError compare_images(const Image& a, const Image& b);

}  // namespace rbvh
