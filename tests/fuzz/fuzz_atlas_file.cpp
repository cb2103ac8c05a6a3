// Arbitrary atlas bytes under the hierarchy of the small test pair, as format 1.x and 2.0 store heights.
#include <cstdlib>

#include "io/atlas_file.h"
#include "pipeline/base/error.h"
#include "tests/format/pair_bytes.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const rbvh::Rbvh expected = rbvh::make_small_rbvh();
  for (const auto stored : {rbvh::StoredHeights::kPlain, rbvh::StoredHeights::kDifferences}) {
    rbvh::Rbvh rbvh = expected;
    try {
      rbvh::decode_atlas(std::as_bytes(std::span(data, size)), "fuzz.atlas.tif", stored, rbvh);
      if (rbvh.levels[0].layers[0].texels.size() != 30) std::abort();
    } catch (const rbvh::Error& error) {
      if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
    }
  }
  return 0;
}
