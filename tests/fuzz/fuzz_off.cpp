// Arbitrary bytes as an OFF file.
#include "io/off.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_off, "fuzz.off", data, size);
}
