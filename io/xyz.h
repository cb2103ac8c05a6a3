// Text with a point a line: XYZ, CSV, PTS and their kin.
#pragma once

#include <string>
#include <string_view>

#include "pipeline/scan/scan.h"

namespace rbvh {

/// One of its first lines has three numbers.
bool is_xyz(std::string_view bytes);

/// Columns are separated by blanks, commas, or semicolons (then a comma is a decimal point). Lines that begin
/// with '#' or
/// "//" are comments; up to two more lines of header are allowed; a lone count on the first line (PTS) is
/// checked against the number of points. A header or comment with one name a column that has x, y and z names
/// the columns (nx ny nz, r g b, red green blue; others are properties). Without names the first three
/// columns are the position; then, from left to right, three columns are normals if they have unit length,
/// else colours if they are integers in 0..255 or all in [0, 1], else one column is a property (the first:
/// "intensity"). In a .pts file of seven columns the intensity comes before the colour. Throws Error(kInput)
/// with the line.
RawScan read_xyz(std::string_view bytes, const std::string& file);

}  // namespace rbvh
