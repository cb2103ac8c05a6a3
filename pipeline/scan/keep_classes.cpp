#include "pipeline/scan/keep_classes.h"

#include <algorithm>
#include <vector>

#include "pipeline/base/error.h"
#include "pipeline/scan/compact.h"

namespace rbvh {

std::size_t keep_classes(RawScan& cloud, std::span<const std::uint8_t> classes, const std::string& file) {
  const auto found = std::find_if(cloud.properties.begin(), cloud.properties.end(),
                                  [](const ScalarProperty& p) { return p.name == "classification"; });
  if (found == cloud.properties.end())
    throw Error(ErrorKind::kUsage, file, "its points have no property 'classification' to be selected by");
  std::vector<std::uint8_t> keep(found->values.size());
  std::size_t removed = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    keep[i] = std::any_of(classes.begin(), classes.end(), [&](std::uint8_t wanted) {
      return found->values[i] == static_cast<float>(wanted);
    });
    removed += !keep[i];
  }
  if (removed == keep.size())
    throw Error(ErrorKind::kInput, file, "no point is of a class that is asked for");
  keep_vertex_entries(cloud, keep);
  keep_entries(cloud.object_ids, keep);
  return removed;
}

}  // namespace rbvh
