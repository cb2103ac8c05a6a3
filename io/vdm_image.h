// Displacement maps: our own, an EXR of three 32-bit floats, written and read back by OpenImageIO.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/base/vec.h"

namespace rbvh {

struct VdmImage {
  std::uint32_t width = 0, height = 0;
  std::vector<Vec3f> texels;  ///< row by row, row 0 on top
};

/// Writes it to `temporary_path` with attributes that say how to read it. Identical texels give identical
/// bytes. Errors name `path`. Throws Error(kFailure).
void write_vdm_exr(const std::string& temporary_path, const std::string& path, const std::vector<Vec3f>& map,
                   std::uint32_t width, std::uint32_t height);

/// Reads what write_vdm_exr() wrote, `width` x `height` texels. Hostile bytes are expected; memory is bounded
/// by 1100 times their number. Throws Error(kInput), naming `path`.
std::vector<Vec3f> decode_vdm_exr(std::string_view file, const std::string& path, std::uint32_t width,
                                  std::uint32_t height);

}  // namespace rbvh
