// PLY: ASCII, little and big endian, any property types and order. A parser of our own, since the libraries
// lose doubles, further properties and non-manifold faces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Begins with PLY's magic line.
bool is_ply(std::string_view bytes);

/// Parses a PLY file in memory. Hostile bytes are expected: counts are checked against the bytes left before
/// anything is allocated. Polygons and triangle strips become triangles; indices are checked. `file` is for
/// messages. Throws Error(kInput).
RawScan read_ply(std::string_view bytes, const std::string& file);

/// A texture's image beside the PLY.
struct PlyImage {
  std::string name;
  std::uint64_t bytes = 0, hash = 0;
};

/// Passes the bytes of the output PLY (scan_io.h's write_ply) to `sink` in pieces. `images`: that of each
/// texture; none: the scan's textures are left out.
void encode_ply(const Scan& scan, const std::function<void(std::span<const std::byte>)>& sink,
                const std::vector<PlyImage>& images = {});

}  // namespace rbvh
