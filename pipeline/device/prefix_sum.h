// Exclusive prefix sum on the device: sums of chunks, their prefix sum by the same means, then the chunks
// again.
#pragma once

#include <cstdint>

#include "pipeline/device/device.h"

namespace rbvh {

/// out[i] = in[0] + ... + in[i - 1] modulo 2^32 for i in [0, count], so `out` has count + 1 elements and
/// out[count] is the total. `in` and `out` may be the same buffer. count < 2^32 - 1024.
void prefix_sum(const Device& device, const Buffer<std::uint32_t>& in, std::size_t count,
                const Buffer<std::uint32_t>& out);

}  // namespace rbvh
