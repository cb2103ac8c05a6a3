// Images of other programs, before OpenImageIO gets them: what they are, and whether they are whole.
#pragma once

#include <string_view>

namespace rbvh {

/// The format by the first bytes, as OpenImageIO names it: openexr, png, jpeg, tiff, bmp, webp; else nullptr.
const char* image_format(std::string_view file);

/// ".png", ".jpg" ... by the first bytes.
const char* image_extension(std::string_view file);

/// A PNG or a JPEG that ends too early. Of a cut PNG libpng would read on past the file's end, for up to 2
/// GB; of a cut JPEG libjpeg makes grey.
bool is_cut_image(std::string_view file);

/// Libraries of images say their errors and warnings on stderr themselves; ours are one line.
class StderrAside {
 public:
  StderrAside();
  ~StderrAside();
  StderrAside(const StderrAside&) = delete;
  StderrAside& operator=(const StderrAside&) = delete;

 private:
  int kept_;
};

}  // namespace rbvh
