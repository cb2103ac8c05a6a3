// The few bytes in which a tile's frame and box are stored, and the rounding that this means. A build rounds
// before it stores, so that a level in memory and the same level read again are equal.
#pragma once

#include <array>
#include <cstdint>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

LeafGrid leaf_grid(const Bounds3f& bounds);

/// The next larger side of a texel that can be stored. Tiles are rasterised with it, as a tile's far end
/// would move by a part of a texel otherwise.
double round_texel(double side);

/// A disc's radius likewise, in 16 bits.
std::uint16_t round_radius(float radius);
float unround_radius(std::uint16_t code);

/// Triangles are stored in their order and with their sides, but may begin with another corner. `mesh` is the
/// level's primitives, and indices are in range.
void rotate_as_stored(Scan& mesh);

/// A tile's frame: which way it lies, the place of (u, v, w) = 0, and its scales.
struct RoundedFrame {
  std::array<std::int16_t, 3> rotation{};  ///< the three smaller parts of a unit quaternion
  std::uint8_t largest = 0;                ///< which part is missing
  std::uint8_t is_left_handed = 0;
  std::array<std::int32_t, 3> corner{};
  std::array<std::uint16_t, 2> texels{};  ///< the sides of a texel: of a float's 32 bits those from bit 15 on
  float quantum = 0;                      ///< scan units

  bool operator==(const RoundedFrame&) const = default;
};
/// What it returns, unround_frame() and it again give back.
RoundedFrame round_frame(const LeafGrid& grid, const float to_tile[12]);
void unround_frame(const LeafGrid& grid, const RoundedFrame& frame, float to_tile[12]);

/// A box that contains the given one, as lo x y z, hi x y z.
using RoundedBox = std::array<std::int32_t, 6>;
RoundedBox round_box(const LeafGrid& grid, const Bounds3f& box);
Bounds3f unround_box(const LeafGrid& grid, const RoundedBox& box);

}  // namespace rbvh
