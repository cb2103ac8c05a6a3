// Arbitrary bytes as a glTF file, GLB or JSON.
#include "io/gltf.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return rbvh::check_reader(rbvh::read_gltf, "fuzz.glb", data, size, 1 << 20);
}
