// Text with a point a line: XYZ, CSV, PTS and their kin.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// One of its first lines has three numbers.
bool is_xyz(std::string_view bytes);

/// Columns by name: "x", 3. Names are those of headers; x, y and z (or easting, northing, height) are wanted,
/// others are normals, colours and properties. Numbers count from 1.
using TextColumns = std::vector<std::pair<std::string, std::size_t>>;

/// "x=3,y=2,z=4", from 1. Throws Error(kUsage).
TextColumns parse_text_columns(std::string_view text);

/// Columns are separated by semicolons, tabs, commas or blanks; where commas do not separate, they are
/// decimal points. Lines that begin with '#' or "//" are comments; up to 32 more lines of header are allowed;
/// a lone count (PTS) is checked against the number of points, and another one behind that many begins
/// another scan. A header or comment with a name a column names the columns (io/property_names.h); one that
/// names no position, or degrees, is refused. `columns`, where given, counts in its place. Without names the
/// first three columns are the position; then, from left to right, three columns are normals if they have
/// unit length, else colours if they are integers in 0..255 or all in [0, 1], else one column is a property
/// (the first: "intensity"). In a .pts file of seven columns the intensity comes before the colour; elsewhere
/// that is told from the values, and noted. Throws Error(kInput) with the line.
RawScan read_xyz_columns(std::string_view bytes, const std::string& file, const TextColumns& columns);
RawScan read_xyz(std::string_view bytes, const std::string& file);

}  // namespace rbvh
