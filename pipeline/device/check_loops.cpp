#include "pipeline/device/check_loops.h"

#include <array>
#include <mutex>
#include <set>
#include <string>

#include "pipeline/base/error.h"

namespace rbvh::device_detail {

void check_loops(const Device& device) {
  static std::mutex mutex;
  static std::set<int> checked;
  const std::lock_guard lock(mutex);
  if (checked.contains(device.info().index)) return;

  constexpr std::uint32_t kIterations = 200'000;  // takes 0.3 ms
  std::uint32_t expected = 0;
  for (std::uint32_t i = 0; i < kIterations; ++i) expected = expected * 1664525u + 1013904223u;
  const Buffer<std::uint32_t> out(device, 2);
  device.kernel("common/check_loops", "check_loops").run(1, 1, kIterations, out);
  std::array<std::uint32_t, 2> got{};
  out.read(got);
  if (got[0] != kIterations || got[1] != expected)
    throw Error(ErrorKind::kDevice, {},
                device.info().name + " ends a kernel's loop after " + std::to_string(got[0]) + " of " +
                    std::to_string(kIterations) +
                    " iterations, and its results would be wrong; choose another device");
  checked.insert(device.info().index);
}

}  // namespace rbvh::device_detail
