// Arbitrary bytes as an STL file.
#include "io/stl.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_stl, "fuzz.stl", data, size);
}
