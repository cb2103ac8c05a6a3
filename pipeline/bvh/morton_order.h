// Elements in the order of their centres along a Morton curve, on the device: what LBVH and PLOC start from.
#pragma once

#include <cstdint>
#include <span>

#include "pipeline/device/device.h"
#include "rbvh/geometry.h"

namespace rbvh {

enum class MortonBits { k30 = 30, k63 = 63 };  ///< of a code: 10 or 21 an axis

struct MortonOrder {
  Buffer<float> boxes;            ///< six floats each, as given
  std::uint32_t count = 0;        ///< usable ones
  Buffer<std::uint32_t> indices;  ///< of the usable boxes, by ascending code; of equal codes as they came
  Buffer<std::uint32_t> codes30;  ///< ascending; the one of the two that was asked for
  Buffer<std::uint64_t> codes63;
  double sort_seconds = 0;  ///< of it all
};

/// Centres are normalised to their own bounds. Boxes that are empty or not finite are left out.
MortonOrder morton_order(const Device& device, std::span<const Bounds3f> boxes, MortonBits bits);

/// Work-items a group for kernels of one short work-item an element.
inline std::size_t element_group_size(const Device& device) { return device.info().is_cpu ? 256 : 64; }

}  // namespace rbvh
