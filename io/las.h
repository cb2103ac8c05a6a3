// LAS 1.0 to 1.4, the format of airborne lidar. LAZ and COPC, which are compressed, become it by
// io/convert_cloud.h.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Begins with LAS's own word; LAZ does, too.
bool is_las(std::string_view bytes);

/// LAZ or COPC, of the bytes of which is_las() holds.
bool is_compressed_las(std::string_view bytes);

/// A cloud of the point formats 0 to 10, with the properties `intensity` (0 to 65535) and `classification` (0
/// to 255). Points marked as withheld are left out, which is noted. Colours are 16-bit words, unless none
/// is above 255: then they are taken for bytes, which is noted, too. Throws Error(kInput) with the byte, also
/// for coordinates in degrees.
RawScan read_las(std::string_view bytes, const std::string& file);

/// The same in bounded memory: `visit` gets one piece of the points after the other. Returns the notes.
std::vector<std::string> read_las_in_pieces(const std::string& path,
                                            const std::function<void(RawScan&& piece)>& visit);

}  // namespace rbvh
