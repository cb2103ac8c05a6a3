// LZF decompression, for compressed PCD. The library's own reads past hostile input.
#pragma once

#include <cstddef>
#include <span>

namespace rbvh {

/// Fills `out` exactly from `in`. Returns false when the data is damaged: a reference before the start, or an
/// output longer or shorter than `out`. Hostile input is expected.
bool lzf_decompress(std::span<const unsigned char> in, std::span<unsigned char> out);

/// No LZF stream grows by more than this factor: three bytes give at most 264.
inline constexpr std::size_t kLzfLargestRatio = 88;

}  // namespace rbvh
