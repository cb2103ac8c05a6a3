// Arbitrary bytes as a displacement map: another program's, and a proxy's own of 8 x 5 texels.
#include <cstdlib>

#include "io/vdm_image.h"
#include "pipeline/base/error.h"

namespace {

template <class Decode>
void check(Decode&& decode) {
  try {
    decode();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
    if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  check([&] {
    const rbvh::VdmMap map = rbvh::decode_vdm_map(bytes, "fuzz.exr");
    if (map.values.size() != std::size_t{map.width} * map.height * map.channels) std::abort();
  });
  check([&] {
    if (rbvh::decode_vdm_exr(bytes, "fuzz.exr", 8, 5).size() != 40) std::abort();
  });
  return 0;
}
