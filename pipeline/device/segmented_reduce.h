// Sum, minimum or maximum of floats over consecutive segments, in one fixed order: within blocks of fixed
// size one after the other, then the blocks of a segment one after the other. The result does not depend on
// the device's width or on how many threads there are, and no atomics are used.
#pragma once

#include <cstdint>

#include "pipeline/device/device.h"

namespace rbvh {

enum class Reduction { kSum, kMin, kMax };

/// out[s] = reduction of values[offsets[s]] .. values[offsets[s + 1] - 1] for s in [0, segments): `offsets`
/// has segments + 1 ascending elements, the last at most `count`. Each of the `count` values is `components`
/// floats (1, 2, 4 or 8) that are reduced apart from each other, and so is each result. An empty segment
/// gives 0, +infinity or -infinity. A NaN makes its sum NaN; minimum and maximum skip it.
void segmented_reduce(const Device& device, Reduction reduction, const Buffer<float>& values,
                      std::size_t count, std::uint32_t components, const Buffer<std::uint32_t>& offsets,
                      std::size_t segments, const Buffer<float>& out);

/// Offsets for segmented_reduce() from `count` ascending segment numbers, all below `segments`; numbers may
/// be missing.
void segment_offsets(const Device& device, const Buffer<std::uint32_t>& ids, std::size_t count,
                     std::size_t segments, const Buffer<std::uint32_t>& offsets);

}  // namespace rbvh
