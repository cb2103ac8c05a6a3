// Where the bytes of a TIFF file are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace rbvh {

/// What the compressed tiles of each subimage take, in the order of the file: of little-endian TIFF and
/// BigTIFF. Bytes may be hostile: the list ends before the first subimage that does not hang together.
std::vector<std::uint64_t> tiff_subimage_bytes(std::span<const std::byte> file);

}  // namespace rbvh
