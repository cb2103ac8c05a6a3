// Host and device agree on kernels/layout.h and its like byte for byte, as the device's compiler itself
// reports it.
#include "kernels/layout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <regex>
#include <set>
#include <string>

#include "kernels/exact_layout.h"
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
#include "tests/kernels/layout_fields.h"
};

TEST(Layout, DeviceAgrees) {
  setenv("RBVH_KERNELS", RBVH_SOURCE "/tests/kernels", 1);
  const Device device = Device::open();
  Buffer<std::uint32_t> out(device, std::size(kEntries));
  out.fill(0xee);
  device.kernel("layout_report", "layout_report").run(1, 1, out);
  const std::vector<std::uint32_t> values = out.read();
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_EQ(values[i], kEntries[i].value) << kEntries[i].name;
}

TEST(Layout, EveryStructIsCompared) {
  std::set<std::string> compared;
  for (const Entry& entry : kEntries) compared.insert(entry.name);
  const std::regex declaration(R"(typedef struct (\w+) \{)");
  for (const char* name : {"layout.h", "exact_layout.h"}) {
    std::ifstream file(std::string(RBVH_SOURCE "/kernels/") + name);
    const std::string text(std::istreambuf_iterator<char>(file), {});
    int structs = 0;
    for (std::sregex_iterator at(text.begin(), text.end(), declaration), end; at != end; ++at, ++structs) {
      EXPECT_TRUE(compared.contains((*at)[1].str())) << (*at)[1].str() << " is missing in layout_fields.h";
    }
    EXPECT_GE(structs, 3) << name;
  }
}

}  // namespace
}  // namespace rbvh
