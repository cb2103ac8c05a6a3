#include "pipeline/bvh/build_exact.h"

#include "pipeline/base/error.h"
#include "pipeline/bvh/lbvh.h"
#include "pipeline/bvh/ploc.h"
#include "pipeline/bvh/sah_binned_bvh.h"
#include "pipeline/bvh/sah_bvh.h"

namespace rbvh {

Bvh build_bvh(const Device& device, ExactBuilder builder, std::span<const Bounds3f> boxes,
              const BvhConfig& config) {
  switch (builder) {
    case ExactBuilder::kSahBinned:
      return build_sah_binned_bvh(boxes, config);
    case ExactBuilder::kSah:
      return build_sah_bvh(boxes, config);
    case ExactBuilder::kLbvh:
      return build_lbvh(device, boxes, config);
    case ExactBuilder::kPloc:
      return build_ploc(device, boxes, config);
    case ExactBuilder::kKd:
      break;
  }
  check_failed("a builder of binary hierarchies", __FILE__, __LINE__);
}

}  // namespace rbvh
