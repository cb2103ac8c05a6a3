// A tile's texels: their places in space, and the meaning of their 16 bits (docs/file_format.md).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "kernels/common/layout.h"
#include "rbvh/geometry.h"

namespace rbvh {

/// From tile space to scan space: the inverse of RbvhLeaf::to_tile, whose rows are orthogonal.
/// `u`, `v`: one texel on; `w`: one quantum up; scan units.
struct TileFrame {
  Vec3d origin, u, v, w;

  explicit TileFrame(const RbvhLeaf& leaf) {
    Vec3d* const axes[3] = {&u, &v, &w};
    for (std::size_t i = 0; i < 3; ++i) {
      const float* row = leaf.to_tile + 4 * i;
      const Vec3d r{static_cast<double>(row[0]), static_cast<double>(row[1]), static_cast<double>(row[2])};
      *axes[i] = r * (1 / dot(r, r));
      origin = origin - *axes[i] * static_cast<double>(row[3]);
    }
  }
  Vec3f at(double x, double y, double height) const {
    return static_cast<Vec3f>(origin + u * x + v * y + w * height);
  }
};

/// (u, v, w) of a point in the leaf's tile.
inline Vec3f to_tile(const RbvhLeaf& leaf, Vec3f p) {
  const float* m = leaf.to_tile;
  return {m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
          m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]};
}

/// A texel of the layer "normal"; unit.
inline Vec3f unpack_normal(std::uint16_t packed) {
  const float x = (static_cast<float>(packed & 255) - 128) / 127,
              y = (static_cast<float>(packed >> 8) - 128) / 127;
  Vec3f n{x, y, 1 - std::abs(x) - std::abs(y)};
  if (n.z < 0) {
    n.x = (1 - std::abs(y)) * (x < 0 ? -1.f : 1.f);
    n.y = (1 - std::abs(x)) * (y < 0 ? -1.f : 1.f);
  }
  return normalized(n);
}

/// The same, packed: octahedral, 8 bits a coordinate; never 0.
inline std::uint16_t pack_normal(Vec3f n) {
  const float sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  if (!(sum > 0)) return 0x8080;
  float x = n.x / sum, y = n.y / sum;
  if (n.z < 0) {
    const float fold = (1 - std::abs(y)) * (n.x < 0 ? -1.f : 1.f);
    y = (1 - std::abs(x)) * (n.y < 0 ? -1.f : 1.f);
    x = fold;
  }
  const auto code = [](float value) {
    return static_cast<std::uint32_t>(std::clamp(std::floor(value * 127 + 128.5f), 1.f, 255.f));
  };
  return static_cast<std::uint16_t>(code(x) | code(y) << 8);
}

/// A texel of the layer "color"; sRGB in [0, 1].
inline Vec3f unpack_srgb(std::uint16_t packed) {
  return {static_cast<float>(packed >> 11) / 31, static_cast<float>((packed >> 5) & 63) / 63,
          static_cast<float>(packed & 31) / 31};
}

/// The same, packed.
inline std::uint16_t pack_srgb(Vec3f c) {
  const auto bits = [](float value, float most) {
    return static_cast<std::uint32_t>(std::clamp(value, 0.0f, 1.0f) * most + 0.5f);
  };
  return static_cast<std::uint16_t>(bits(c.x, 31) << 11 | bits(c.y, 63) << 5 | bits(c.z, 31));
}

}  // namespace rbvh
