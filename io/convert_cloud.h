// Clouds of formats that another program unpacks: LAZ, COPC and E57, by `rbvh-convert` (tools/convert), where
// it is on the PATH.
#pragma once

#include <string>
#include <string_view>

namespace rbvh {

/// What rbvh-convert makes of the bytes: LAS of "laz", lines of x, y, z and colour of "e57". `file` is for
/// messages. Throws Error(kInput) where the program is not there, fails, or writes more than the bytes can
/// hold.
std::string convert_cloud(std::string_view bytes, const std::string& kind, const std::string& file);

}  // namespace rbvh
