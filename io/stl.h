// STL, ASCII and binary. A binary file may begin with 'solid' too: its length decides.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/scan.h"

namespace rbvh {

/// Has the length a binary STL of its count has, or begins like an ASCII one.
bool is_stl(std::string_view bytes);

/// Corners at exactly the same position become one vertex. Several solids of an ASCII file are object ids.
/// Throws Error(kInput) with the byte or line.
RawScan read_stl(std::string_view bytes, const std::string& file);

}  // namespace rbvh
