// Arbitrary bytes as a PCD file.
#include "io/pcd.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_pcd, "fuzz.pcd", data, size);
}
