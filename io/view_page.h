// The page that the viewer's script is in, from web/viewer.html, and what is put into it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace rbvh {

/// The page without a pair: its places are @NAME@.
extern const char* const kViewerPage;

std::string encode_base64(std::span<const std::uint8_t> bytes);

/// Text for HTML's elements and attributes.
std::string escape_html(std::string_view text);

}  // namespace rbvh
