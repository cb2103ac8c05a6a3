// Hierarchies with a true seal around arbitrary bytes: what gets through must be safe to flatten for the
// kernels.
#include <cstdlib>

#include "io/rbvh_file.h"
#include "pipeline/base/error.h"
#include "pipeline/bvh/wide_bvh.h"
#include "tests/format/pair_bytes.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  rbvh::Bytes bytes(data, data + size);
  rbvh::reseal(bytes);
  rbvh::PairHeader header;
  try {
    const rbvh::Rbvh rbvh = rbvh::decode_hierarchy(std::as_bytes(std::span(bytes)), "fuzz.rbvh", header);
    for (const rbvh::Level& level : rbvh.levels) {
      rbvh::Bvh bvh;
      for (const rbvh::RbvhNode& n : level.nodes)
        bvh.nodes.push_back({{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}, n.first, n.count});
      std::vector<std::uint32_t> leaves;
      rbvh::widen(bvh, leaves);
      if (leaves.size() != level.leaves.size()) std::abort();
    }
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
  }
  return 0;
}
