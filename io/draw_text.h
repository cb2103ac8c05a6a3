// Text in pictures, by OpenImageIO and FreeType.
#pragma once

#include <span>
#include <string>

#include "pipeline/render/decorate.h"
#include "rbvh/image.h"

namespace rbvh {

/// Draws texts into a picture of R, G, B, A. `font`: a file that FreeType reads; empty: the first found of
/// those that systems usually have. Returns what went wrong, such as that there is no font, and then draws
/// nothing.
std::string draw_texts(std::span<const Text> texts, const std::string& font, Image& picture);

}  // namespace rbvh
