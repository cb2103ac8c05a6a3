// The hash of file contents, as pairs record their source's and their own.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rbvh {

/// XXH3, 64 bits.
std::uint64_t hash_bytes(std::string_view bytes);

/// The same of a file's bytes, in little memory. Throws Error(kInput) where it cannot be read.
std::uint64_t hash_file(const std::string& path);

}  // namespace rbvh
