// What the fuzz targets of the scan readers share: whatever bytes come, a reader gives a consistent scan or
// Error(kInput).
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "pipeline/base/error.h"
#include "rbvh/scan.h"

namespace rbvh {

inline bool is_consistent(const ScanAttributes& scan, std::size_t vertices) {
  const auto fits = [&](std::size_t size) { return size == 0 || size == vertices; };
  if (!fits(scan.normals.size()) || !fits(scan.radii.size()) || !fits(scan.colors.size())) return false;
  for (const ScalarProperty& property : scan.properties)
    if (property.values.size() != vertices) return false;
  for (const Triangle& triangle : scan.triangles)
    for (const std::uint32_t corner : triangle)
      if (corner >= vertices) return false;
  const std::size_t elements = scan.triangles.empty() ? vertices : scan.triangles.size();
  if (!scan.face_textures.empty() && scan.face_textures.size() != scan.triangles.size()) return false;
  for (const FaceTexture& face : scan.face_textures)
    if (face.texture != FaceTexture::kNone && face.texture >= scan.textures.size()) return false;
  for (const Texture& texture : scan.textures)
    if (texture.image == nullptr) return false;
  return scan.object_ids.empty() || scan.object_ids.size() == elements;
}

/// Memory is bounded by the input: the densest are compressed PCD, up to 88 one-byte values from a byte, and
/// lists of indices, a byte each. `more`: what instances may come to whatever the bytes.
inline bool is_bounded(const ScanAttributes& scan, std::size_t vertices, std::size_t bytes,
                       std::size_t more) {
  return vertices <= 88 * bytes + more && scan.triangles.size() <= bytes + more &&
         scan.properties.size() <= bytes;
}

template <class Read>
int check_reader(Read read, const char* name, const std::uint8_t* data, std::size_t size,
                 std::size_t more = 0) {
  try {
    const RawScan scan = read(std::string_view(reinterpret_cast<const char*>(data), size), std::string(name));
    const std::size_t vertices = scan.positions.size();
    if (!is_consistent(scan, vertices) || !is_bounded(scan, vertices, size, more)) std::abort();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput) std::abort();
    if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
  }
  return 0;
}

}  // namespace rbvh
