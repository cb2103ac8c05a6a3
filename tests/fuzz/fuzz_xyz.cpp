// Arbitrary bytes as an XYZ file.
#include "io/xyz.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_xyz, "fuzz.xyz", data, size);
}
