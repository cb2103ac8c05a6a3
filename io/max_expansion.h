// A bound on what hostile bytes make a reader reserve.
#pragma once

#include <cstdint>

namespace rbvh {

/// What a byte of deflate can become at most (1032), and some room for tiles' padding; streams by zstd are
/// held to it, too (docs/file_format.md).
inline constexpr std::uint64_t kMaxExpansion = 1100;

}  // namespace rbvh
