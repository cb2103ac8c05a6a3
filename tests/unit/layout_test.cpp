// Host and device agree on kernels/common/layout.h and its like byte for byte, as the device's compiler
// itself reports it.
#include "kernels/common/layout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include "kernels/bvh/bvh_layout.h"
#include "kernels/bvh/linked_layout.h"
#include "kernels/common/patch_layout.h"
#include "kernels/common/ray_queue_layout.h"
#include "kernels/common/scene_layout.h"
#include "pipeline/device/device.h"

namespace rbvh {
namespace {

struct Entry {
  std::string name;
  std::size_t value;
};

const Entry kEntries[] = {
#define SIZE(type) {#type, sizeof(type)},
#define FIELD(type, field) {#type "." #field, offsetof(type, field)},
#include "layout_fields.h"
};

TEST(Layout, DeviceAgrees) {
  setenv("RBVH_KERNELS", RBVH_LAYOUT_KERNELS, 1);
  const Device device = Device::open();
  Buffer<std::uint32_t> out(device, std::size(kEntries));
  out.fill(0xee);
  device.kernel("layout_report", "layout_report").run(1, 1, out);
  const std::vector<std::uint32_t> values = out.read();
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_EQ(values[i], kEntries[i].value) << kEntries[i].name;
}

TEST(Layout, TheListOfStructsIsWhole) {
  const auto structs = std::count_if(std::begin(kEntries), std::end(kEntries),
                                     [](const Entry& e) { return e.name.find('.') == std::string::npos; });
  std::size_t declared = 0;
  for (const char* name : {"common/layout.h", "bvh/bvh_layout.h", "bvh/linked_layout.h",
                           "common/patch_layout.h", "common/ray_queue_layout.h", "common/scene_layout.h"}) {
    std::ifstream file(std::string(RBVH_SOURCE "/kernels/") + name);
    const std::string text(std::istreambuf_iterator<char>(file), {});
    for (std::size_t at = 0; (at = text.find("\ntypedef struct ", at)) != std::string::npos; ++at) ++declared;
  }
  EXPECT_GT(declared, 5u);
  EXPECT_EQ(static_cast<std::size_t>(structs), declared);
}

}  // namespace
}  // namespace rbvh
