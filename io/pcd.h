// PCD: ASCII, binary and compressed, organised or not. A parser of our own: the library reads doubles as
// zeros and aborts on hostile counts.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/scan.h"

namespace rbvh {

/// Begins like a PCD header.
bool is_pcd(std::string_view bytes);

/// Fields x y z (any type), normal_x.., rgb or rgba (packed) have their meaning, further fields of count 1
/// are properties. Points of an organised cloud that are NaN stay. Throws Error(kInput) with the line or
/// byte.
RawScan read_pcd(std::string_view bytes, const std::string& file);

}  // namespace rbvh
