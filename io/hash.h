// The hash of file contents, as pairs record their source's and their own.
#pragma once

#include <cstdint>
#include <string_view>

namespace rbvh {

/// XXH3, 64 bits.
std::uint64_t hash_bytes(std::string_view bytes);

}  // namespace rbvh
