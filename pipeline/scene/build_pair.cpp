#include "pipeline/rbvh/build.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/build.h"

namespace rbvh {

Asset build_pair(const Device& device, const Scan& scan, const BuildConfig& config, const Progress& progress,
                 BuildTimings* timings) {
  return make_asset(build_rbvh(device, scan, config, progress, timings));
}

}  // namespace rbvh
