#include "io/difference_pictures.h"

#include <filesystem>

#include "io/image.h"
#include "pipeline/base/error.h"
#include "pipeline/measure/difference.h"

namespace rbvh {

std::function<void(const MeasuredView&)> difference_writer(const std::string& folder,
                                                           const std::vector<std::string>& levels,
                                                           float diagonal, bool overwrite) {
  std::error_code code;
  std::filesystem::create_directories(folder, code);
  if (code) throw Error(ErrorKind::kFailure, folder, "the folder cannot be made: " + code.message());
  return [=](const MeasuredView& view) {
    const std::string name = levels[view.level] + "-" + std::to_string(view.view) + ".png";
    write_image((std::filesystem::path(folder) / name).string(),
                difference_image(view.exact, view.hits, view.rays, diagonal, 2), overwrite);
  };
}

}  // namespace rbvh
