#include "pipeline/device/check_loops.h"

#include <array>
#include <mutex>
#include <set>
#include <string>

#include "pipeline/base/error.h"

namespace rbvh::device_detail {
namespace {

std::mutex g_mutex;
std::set<int> g_checked;

}  // namespace

bool are_loops_checked(const Device& device) {
  const std::lock_guard lock(g_mutex);
  return g_checked.contains(device.info().index);
}

void check_loops(const Device& device, const Kernel& kernel) {
  constexpr std::uint32_t kIterations = 200'000;  // takes 0.3 ms
  std::uint32_t expected = 0;
  for (std::uint32_t i = 0; i < kIterations; ++i) expected = expected * 1664525u + 1013904223u;
  const Buffer<std::uint32_t> out(device, 2);
  kernel.run(1, 1, kIterations, out);
  std::array<std::uint32_t, 2> got{};
  out.read(got);
  if (got[0] != kIterations || got[1] != expected)
    throw Error(ErrorKind::kDevice, {},
                device.info().name + " ends a kernel's loop after " + std::to_string(got[0]) + " of " +
                    std::to_string(kIterations) +
                    " iterations, and its results would be wrong; choose another device");
  const std::lock_guard lock(g_mutex);
  g_checked.insert(device.info().index);
}

}  // namespace rbvh::device_detail
