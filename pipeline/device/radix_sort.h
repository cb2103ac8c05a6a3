// Stable least-significant-digit radix sort on the device: per digit, chunk histograms, their prefix sum, and
// a scatter that keeps each chunk's order.
#pragma once

#include <cstdint>

#include "pipeline/device/device.h"

namespace rbvh {

/// Sorts the first `count` pairs by key, ascending; pairs of equal keys keep their order. Only the lowest
/// `key_bits` bits are looked at. Takes as much memory again. count < 2^32 - 1024.
void radix_sort(const Device& device, Buffer<std::uint32_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, unsigned key_bits = 32);
void radix_sort(const Device& device, Buffer<std::uint64_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, unsigned key_bits = 64);

}  // namespace rbvh
