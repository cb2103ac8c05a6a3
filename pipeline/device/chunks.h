// How the device primitives split their work: each work-item takes one contiguous chunk in order. A CPU gets
// a few long chunks, so that counters stay in its first-level cache; a GPU gets many short ones. No result
// depends on it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/device/device.h"

namespace rbvh {

struct Chunks {
  std::uint32_t length = 0;  ///< elements of each chunk but the last
  std::uint32_t count = 0;   ///< work-items
  std::size_t local = 1;     ///< work-group size: one per kind of device, as each size compiles anew
};

/// Chunks of `elements`; `gpu_length` is the length on anything but a CPU.
inline Chunks make_chunks(const DeviceInfo& device, std::size_t elements, std::uint32_t gpu_length) {
  constexpr std::uint32_t kChunksPerCore = 4, kShortestOnCpu = 2048;
  RBVH_CHECK(elements <= std::numeric_limits<std::uint32_t>::max() - gpu_length);
  const auto total = static_cast<std::uint32_t>(elements);
  Chunks chunks;
  chunks.length = device.is_cpu
                      ? std::max(kShortestOnCpu, total / (device.compute_units * kChunksPerCore) + 1)
                      : gpu_length;
  chunks.count = total / chunks.length + (total % chunks.length > 0 ? 1 : 0);
  chunks.local = device.is_cpu ? 1 : 64;
  return chunks;
}

}  // namespace rbvh
