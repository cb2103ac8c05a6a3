// Arbitrary bytes as a PLY file.
#include "io/ply.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_ply, "fuzz.ply", data, size);
}
