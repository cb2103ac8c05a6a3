// OFF and its variants: colours, normals, texture coordinates and homogeneous vertices before the three
// letters.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/scan.h"

namespace rbvh {

/// Begins with the word OFF, with or without the letters of a variant.
bool is_off(std::string_view bytes);

/// A vertex or a face a line. Vertices of a plain OFF that have 3 or 4 numbers more have colours. Colours of
/// faces and texture coordinates are noted, not kept. Throws Error(kInput) with the line.
RawScan read_off(std::string_view bytes, const std::string& file);

}  // namespace rbvh
