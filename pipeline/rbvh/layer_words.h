// Layers as a user names them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rbvh {

/// A level's or a layer's name: 1 to 32 letters, digits, _ and -. Throws Error(kUsage).
std::string parse_name(std::string_view text);

/// "a,b": names. Throws Error(kUsage).
std::vector<std::string> parse_names(std::string_view text);

/// A layer's texels to one of the heights', 1/16 to 16. Throws Error(kUsage).
double parse_layer_scale(std::string_view text);

}  // namespace rbvh
