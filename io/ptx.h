// PTX, Leica's text format: scans as grids of points, each with where its scanner stood.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/scan.h"

namespace rbvh {

/// Two lone counts, then four lines of three numbers and four of four.
bool is_ptx(std::string_view bytes);

/// Each scan's points are moved by its matrix and get an object id and a viewpoint. Cells without a return
/// (0 0 0) are left out, which is noted. Throws Error(kInput) with the line.
RawScan read_ptx(std::string_view bytes, const std::string& file);

}  // namespace rbvh
