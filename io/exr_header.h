// What has to be checked of a hostile EXR before OpenEXR reads it.
#pragma once

#include <string_view>

namespace rbvh {

/// Whether the file holds all that its headers claim: OpenEXR makes room for an attribute before it reads it,
/// for up to 2 GB.
bool exr_headers_fit(std::string_view file);

}  // namespace rbvh
