// Numbers and nouns as messages have them.
#pragma once

#include <cstdint>
#include <string>

namespace rbvh {

/// "12.3 MB".
std::string format_bytes(std::uint64_t bytes);

/// "levels" of "level", "leaves" of "leaf".
std::string plural(const std::string& noun);
/// "1 level", "2 levels".
std::string counted(std::uint64_t count, const std::string& noun);

/// Line breaks become spaces, and those at the end go.
std::string one_line(std::string text);

}  // namespace rbvh
