#include "pipeline/device/segmented_reduce.h"

#include <string>

#include "pipeline/base/error.h"
#include "pipeline/device/chunks.h"

namespace rbvh {

void segmented_reduce(const Device& device, Reduction reduction, const Buffer<float>& values,
                      std::size_t count, std::uint32_t components, const Buffer<std::uint32_t>& offsets,
                      std::size_t segments, const Buffer<float>& out) {
  constexpr std::uint32_t kBlock = 256;  // part of the result: it fixes the order of additions
  RBVH_CHECK(components == 1 || components == 2 || components == 4 || components == 8);
  RBVH_CHECK(values.size() >= count * components && offsets.size() > segments &&
             out.size() >= segments * components);
  if (segments == 0) return;
  // One block more than the values fill, for empty segments at the very end.
  const std::size_t blocks = count / kBlock + 1;
  Chunks chunks = make_chunks(device.info(), blocks * kBlock, kBlock);
  chunks.length = (chunks.length + kBlock - 1) / kBlock;  // in blocks
  const std::string options = "-DBLOCK=" + std::to_string(kBlock) +
                              " -DCOMPONENTS=" + std::to_string(components) +
                              " -DREDUCTION=" + std::to_string(static_cast<int>(reduction));
  const Buffer<float> heads(device, blocks * components);
  const auto block_count = static_cast<std::uint32_t>(blocks);
  const auto segment_count = static_cast<std::uint32_t>(segments);
  device.kernel("common/segmented_reduce", "segmented_reduce_blocks", options)
      .run(chunks.count, chunks.local, values, chunks.length, block_count, offsets, segment_count, heads,
           out);
  device.kernel("common/segmented_reduce", "segmented_reduce_join", options)
      .run(chunks.count, chunks.local, chunks.length, block_count, offsets, segment_count, heads, out);
}

void segment_offsets(const Device& device, const Buffer<std::uint32_t>& ids, std::size_t count,
                     std::size_t segments, const Buffer<std::uint32_t>& offsets) {
  constexpr std::uint32_t kGpuChunk = 16;
  RBVH_CHECK(ids.size() >= count && offsets.size() > segments);
  const Chunks chunks = make_chunks(device.info(), count + 1, kGpuChunk);
  device
      .kernel("common/segmented_reduce", "segmented_reduce_offsets", "-DBLOCK=1 -DCOMPONENTS=1 -DREDUCTION=0")
      .run(chunks.count, chunks.local, ids, static_cast<std::uint32_t>(count), chunks.length,
           static_cast<std::uint32_t>(segments), offsets);
}

}  // namespace rbvh
