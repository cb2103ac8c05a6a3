// Arbitrary bytes as an OBJ file.
#include "io/obj.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_obj, "fuzz.obj", data, size);
}
