// The atlas file of a pair: a 16-bit unsigned TIFF by libtiff with one subimage per level and layer, named
// "<level>.<layer>" by its ImageDescription.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Writes all layers to `temporary_path` and returns the bytes that each level takes there. The texels must
/// fit the atlases (find_texel_fault). Identical texels give identical bytes. Errors name `path`. Throws
/// Error(kFailure).
std::vector<std::uint64_t> write_atlas(const std::string& temporary_path, const std::string& path,
                                       const Rbvh& rbvh);

/// How heights are stored: since format 2.0 as differences to the texel above in their tile, which the TIFF
/// predictor then takes the differences along rows of: of a smooth surface little is left.
enum class StoredHeights { kPlain, kDifferences };

/// Fills the texels and stored bytes of `rbvh`, whose levels and layers say what to expect, from the bytes of
/// an atlas file, which may have more levels only where `among_others`. Hostile bytes are expected: memory is
/// bounded by 1100 times their number. Throws Error(kInput), naming `path`.
void decode_atlas(std::span<const std::byte> file, const std::string& path, StoredHeights stored, Rbvh& rbvh,
                  bool among_others = false);

}  // namespace rbvh
