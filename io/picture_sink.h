// Where pictures go: each to a file of its own, or all to one, as a sheet or as a GIF that plays them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/render/look.h"
#include "rbvh/image.h"

namespace rbvh {

class PictureSink {
 public:
  PictureSink() = default;
  /// Throws Error(kUsage) where the extension is none of an image's that can hold `kind`.
  PictureSink(const std::string& path, Image::Kind kind, bool overwrite, std::optional<SheetSize> sheet);

  bool is_one() const { return sheet_ || is_movie_; }  ///< all go to one file
  bool is_exr() const { return is_exr_; }

  /// Writes the picture to `name`, or keeps it. Throws Error(kUsage) where a sheet is full, Error(kFailure).
  void add(const std::string& name, Image&& picture);
  /// Writes what was kept to `name`; false: there is nothing.
  bool finish(const std::string& name);

 private:
  bool overwrite_ = false, is_movie_ = false, is_exr_ = false;
  std::optional<SheetSize> sheet_;
  std::vector<Image> kept_;
};

}  // namespace rbvh
