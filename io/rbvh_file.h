// The file pair NAME.rbvh + NAME.atlas.tif (docs/file_format.md).
#pragma once

#include <string>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// The atlas that belongs to an .rbvh path: beside it, by stem.
std::string atlas_path(const std::string& rbvh_path);

/// Reads and checks a pair: identifier, version, length, hash, verifier, every range, the atlas's hash and geometry.
/// Hostile input is expected. Throws Error(kInput) naming the first fault in a sentence.
Rbvh read_rbvh(const std::string& path);

struct RbvhBytes {
  std::uint64_t hierarchy = 0, atlas = 0;
};

/// Writes both files so that no moment shows an old hierarchy with a new atlas; both whole or neither. Identical
/// input gives identical bytes. Throws Error(kFailure).
RbvhBytes write_rbvh(const std::string& path, const Rbvh& rbvh, bool overwrite);

}  // namespace rbvh
