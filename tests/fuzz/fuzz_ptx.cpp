// Arbitrary bytes as a PTX file.
#include "io/ptx.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_ptx, "fuzz.ptx", data, size);
}
