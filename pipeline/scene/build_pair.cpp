#include <utility>

#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/build_options.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/build.h"

namespace rbvh {

Asset build_pair(const Device& device, const Scan& scan, const BuildConfig& config, const Progress& progress,
                 BuildTimings* timings) {
  Rbvh rbvh = build_rbvh(device, scan, config, progress, timings);
  rbvh.build_options = build_options_json(config);
  return make_asset(std::move(rbvh));
}

}  // namespace rbvh
