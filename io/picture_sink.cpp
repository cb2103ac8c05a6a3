#include "io/picture_sink.h"

#include <filesystem>

#include "io/image.h"
#include "pipeline/base/error.h"
#include "pipeline/base/text.h"

namespace rbvh {

PictureSink::PictureSink(const std::string& path, Image::Kind kind, bool overwrite,
                         std::optional<SheetSize> sheet)
    : overwrite_(overwrite),
      is_movie_(std::filesystem::path(path).extension() == ".gif"),
      is_exr_(image_format(is_movie_ ? "movie.png" : path, kind) == ImageFormat::kExr),
      sheet_(sheet) {
  if (sheet_ && is_movie_) throw Error(ErrorKind::kUsage, path, "a .gif plays pictures, and a sheet is one");
  if (sheet_ && kind == Image::Kind::kData)
    throw Error(ErrorKind::kUsage, path, "a sheet is of pictures to look at, and these are numbers");
}

void PictureSink::add(const std::string& name, Image&& picture) {
  if (!is_one()) return write_image(name, picture, overwrite_);
  if (sheet_ && kept_.size() == sheet_->columns * sheet_->rows)
    throw Error(ErrorKind::kUsage, name,
                "the sheet has room for " + counted(kept_.size(), "picture") + ", and there are more");
  kept_.push_back(std::move(picture));
}

bool PictureSink::finish(const std::string& name) {
  if (kept_.empty()) return false;
  if (is_movie_)
    write_movie(name, kept_, overwrite_);
  else
    write_image(name, make_sheet(kept_, sheet_->columns, sheet_->rows), overwrite_);
  kept_.clear();
  return true;
}

}  // namespace rbvh
