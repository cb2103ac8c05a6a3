// The builders of binary hierarchies behind one call.
#pragma once

#include <span>

#include "pipeline/bvh/bvh.h"
#include "pipeline/bvh/exact_methods.h"
#include "pipeline/device/device.h"

namespace rbvh {

/// `builder` makes TreeKind::kBvh. `device` is used by those that run there.
Bvh build_bvh(const Device& device, ExactBuilder builder, std::span<const Bounds3f> boxes,
              const BvhConfig& config);

}  // namespace rbvh
