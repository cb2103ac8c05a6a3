// Arbitrary bytes as the material library of an OBJ file.
#include <cstdlib>

#include "io/obj_materials.h"
#include "pipeline/base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    for (const auto& [name, map] :
         rbvh::read_obj_materials({reinterpret_cast<const char*>(data), size}, "fuzz.mtl"))
      if (map.image.empty()) std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
  }
  return 0;
}
