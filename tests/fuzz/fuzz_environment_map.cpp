// Arbitrary bytes as an environment map.
#include <cmath>
#include <cstdlib>

#include "io/environment_file.h"
#include "pipeline/base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const rbvh::Image map =
        rbvh::decode_environment_map({reinterpret_cast<const char*>(data), size}, "fuzz.hdr");
    if (map.width == 0 || map.pixels.size() != std::size_t{3} * map.width * map.height) std::abort();
    for (const float value : map.pixels)
      if (!(value >= 0) || std::isinf(value)) std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
    if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
  }
  return 0;
}
