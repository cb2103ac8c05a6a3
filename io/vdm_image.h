// Displacement maps by OpenImageIO: our own, an EXR of three 32-bit floats, written and read; those of other
// programs, read.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/proxy/import_vdm.h"

namespace rbvh {

/// The bytes of an EXR of three 32-bit floats, with attributes that say how to read it. Identical texels give
/// identical bytes. Throws Error(kFailure), naming `path`.
std::vector<unsigned char> encode_vdm_exr(const std::string& path, const std::vector<Vec3f>& map,
                                          std::uint32_t width, std::uint32_t height);

/// Reads what encode_vdm_exr() made, `width` x `height` texels. Hostile bytes are expected; memory is bounded
/// by 1100 times their number. Throws Error(kInput), naming `path`.
std::vector<Vec3f> decode_vdm_exr(std::string_view file, const std::string& path, std::uint32_t width,
                                  std::uint32_t height);

/// Reads any displacement map: EXR, PNG or TIFF with one channel (heights) or three and more, of which R, G
/// and B (or the first three) are taken. Hostile bytes are expected. Throws Error(kInput), naming `path`.
VdmMap decode_vdm_map(std::string_view file, const std::string& path);
VdmMap read_vdm_map(const std::string& path);

}  // namespace rbvh
