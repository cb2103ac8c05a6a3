#include "pipeline/device/prefix_sum.h"

#include "pipeline/base/error.h"
#include "pipeline/device/chunks.h"

namespace rbvh {

void prefix_sum(const Device& device, const Buffer<std::uint32_t>& in, std::size_t count,
                const Buffer<std::uint32_t>& out) {
  constexpr std::uint32_t kGpuChunk = 32;
  RBVH_CHECK(in.size() >= count && out.size() > count);
  const Chunks chunks = make_chunks(device.info(), count, kGpuChunk);
  const auto total = static_cast<std::uint32_t>(count);
  Buffer<std::uint32_t> starts(device, chunks.count + 1u);
  if (chunks.count > 1) {
    device.kernel("common/prefix_sum", "prefix_sum_chunk_totals")
        .run(chunks.count, chunks.local, in, total, chunks.length, chunks.count, starts);
    prefix_sum(device, starts, chunks.count, starts);
  } else {
    starts.fill(0);
  }
  device.kernel("common/prefix_sum", "prefix_sum_chunks")
      .run(std::max(1u, chunks.count), chunks.local, in, total, chunks.length, std::max(1u, chunks.count),
           starts, out);
}

}  // namespace rbvh
