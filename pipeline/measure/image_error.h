// How different two pictures look: RMSE, PSNR and SSIM (Wang, Bovik, Sheikh, Simoncelli, "Image quality
// assessment: from error visibility to structural similarity", 2004).
#pragma once

#include "pipeline/render/image.h"

namespace rbvh {

struct ImageError {
  double rmse = 0;  ///< of the sRGB values in [0, 1]
  double psnr = 0;  ///< decibels; +infinity for equal pictures
  double ssim = 1;  ///< of the grey values, Gaussian windows of 11 pixels; at most 1
};

/// Both R G B A of kind kColor and one size, laid over mid grey and compared as an 8-bit picture would show
/// them: what is brighter than white is white, NaN is black. Means are over the pixels that either picture
/// covers; two empty pictures are equal.
ImageError compare_images(const Image& a, const Image& b);

}  // namespace rbvh
