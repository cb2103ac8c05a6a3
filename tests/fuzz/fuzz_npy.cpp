// Arbitrary bytes as a .npy file.
#include <cstdlib>

#include "io/npy.h"
#include "pipeline/base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kColumns[] = {6, 8};
  try {
    const rbvh::FloatTable table =
        rbvh::decode_npy({reinterpret_cast<const char*>(data), size}, "fuzz.npy", kColumns);
    if (table.values.size() != table.rows * table.columns || table.values.size() * 4 > size) std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
  }
  return 0;
}
