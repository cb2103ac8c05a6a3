// The builders of binary hierarchies behind one call.
#pragma once

#include <span>

#include "pipeline/device/device.h"
#include "pipeline/exact/bvh.h"
#include "pipeline/exact/exact_methods.h"

namespace rbvh {

/// `builder` makes TreeKind::kBvh. `device` is used by those that run there.
Bvh build_bvh(const Device& device, ExactBuilder builder, std::span<const Bounds3f> boxes,
              const BvhConfig& config);

}  // namespace rbvh
