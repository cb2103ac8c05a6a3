// Arbitrary bytes as a LAS file.
#include "io/las.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_las, "fuzz.las", data, size);
}
