#include "pipeline/device/radix_sort.h"

#include <string>

#include "pipeline/base/error.h"
#include "pipeline/device/chunks.h"
#include "pipeline/device/prefix_sum.h"

namespace rbvh {
namespace {

template <class Key>
void sort_pairs(const Device& device, Buffer<Key>& keys, Buffer<std::uint32_t>& values, std::size_t count,
                unsigned key_bits) {
  constexpr std::uint32_t kGpuChunk = 512;
  RBVH_CHECK(keys.size() >= count && values.size() >= count && key_bits <= 8 * sizeof(Key));
  if (count < 2 || key_bits == 0) return;
  const Chunks chunks = make_chunks(device.info(), count, kGpuChunk);
  // A CPU's counters fit its first-level cache; a GPU's work-items have little memory of their own.
  const unsigned digit_bits = device.info().is_cpu ? 8 : 4;
  const auto total = static_cast<std::uint32_t>(count);
  const std::string options = std::string("-DKEY=") + (sizeof(Key) == 8 ? "ulong" : "uint") +
                              " -DDIGIT_BITS=" + std::to_string(digit_bits);
  const Kernel count_digits = device.kernel("common/radix_sort", "radix_sort_count", options);
  const Kernel scatter = device.kernel("common/radix_sort", "radix_sort_scatter", options);
  const std::size_t counters = static_cast<std::size_t>(chunks.count) << digit_bits;
  const Buffer<std::uint32_t> starts(device, counters + 1);
  Buffer<Key> other_keys(device, count);
  Buffer<std::uint32_t> other_values(device, count);
  Buffer<Key>*from_keys = &keys, *to_keys = &other_keys;
  Buffer<std::uint32_t>*from_values = &values, *to_values = &other_values;
  for (std::uint32_t shift = 0; shift < key_bits; shift += digit_bits) {
    const std::uint32_t mask = (1u << std::min(digit_bits, key_bits - shift)) - 1u;
    count_digits.run(chunks.count, chunks.local, *from_keys, total, chunks.length, chunks.count, shift, mask,
                     starts);
    prefix_sum(device, starts, counters, starts);
    scatter.run(chunks.count, chunks.local, *from_keys, *from_values, total, chunks.length, chunks.count,
                shift, mask, starts, *to_keys, *to_values);
    std::swap(from_keys, to_keys);
    std::swap(from_values, to_values);
  }
  if (from_keys != &keys) {
    keys.copy_from(*from_keys, count);
    values.copy_from(*from_values, count);
  }
}

}  // namespace

void radix_sort(const Device& device, Buffer<std::uint32_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, unsigned key_bits) {
  sort_pairs(device, keys, values, count, key_bits);
}

void radix_sort(const Device& device, Buffer<std::uint64_t>& keys, Buffer<std::uint32_t>& values,
                std::size_t count, unsigned key_bits) {
  sort_pairs(device, keys, values, count, key_bits);
}

}  // namespace rbvh
