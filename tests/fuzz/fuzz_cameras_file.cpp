// Arbitrary bytes as a file of cameras.
#include <cstdlib>

#include "io/cameras_file.h"
#include "pipeline/base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    if (rbvh::decode_cameras({reinterpret_cast<const char*>(data), size}, "fuzz.json", {}).empty())
      std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
    if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
  }
  return 0;
}
