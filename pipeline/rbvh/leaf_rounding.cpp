#include "pipeline/rbvh/leaf_rounding.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

constexpr double kRotationScale =
    32767 * std::numbers::sqrt2_v<double>;  // smaller parts are within +-sqrt(1/2)
constexpr int kTexelShift = 15;
/// What is this much too long, relatively, is a side's own rounding.
constexpr double kSideRounding = 1e-5;
/// Of the level's extent: frames are placed to a small part of a texel, boxes need not be.
constexpr float kFrameSteps = 1 << 20, kBoxSteps = 1 << 16;
/// What is this close to a grid point lies on it: rounding twice must not move it further.
constexpr double kOnGrid = 1e-2;
constexpr int kMostRoundings = 8;

std::int32_t to_int(double value) {
  return static_cast<std::int32_t>(std::clamp(value, -2147483647.0, 2147483647.0));
}

/// Of the rotation whose matrix has these rows (Shepperd's method, for the largest part).
std::array<double, 4> quaternion(const Vec3d r[3]) {
  const double t[4] = {r[0].x + r[1].y + r[2].z, r[0].x - r[1].y - r[2].z, r[1].y - r[0].x - r[2].z,
                       r[2].z - r[0].x - r[1].y};
  const auto largest = static_cast<std::size_t>(std::max_element(t, t + 4) - t);
  const double a = 0.5 * std::sqrt(std::max(0.0, 1 + t[largest])), b = 0.25 / std::max(a, 1e-30);
  const double x = r[2].y - r[1].z, y = r[0].z - r[2].x, z = r[1].x - r[0].y;
  const double xy = r[0].y + r[1].x, yz = r[1].z + r[2].y, zx = r[2].x + r[0].z;
  switch (largest) {
    case 0:
      return {a, x * b, y * b, z * b};
    case 1:
      return {x * b, a, xy * b, zx * b};
    case 2:
      return {y * b, xy * b, a, yz * b};
    default:
      return {z * b, zx * b, yz * b, a};
  }
}

void rows_of(const std::array<double, 4>& q, Vec3d r[3]) {
  const auto [w, x, y, z] = q;
  r[0] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)};
  r[1] = {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)};
  r[2] = {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
}

std::uint16_t texel_code(double side) {
  return static_cast<std::uint16_t>(std::bit_cast<std::uint32_t>(static_cast<float>(side)) >> kTexelShift);
}

/// Without the last four bits, as a frame's rows in floats do not have these of its quantum.
float round_quantum(double quantum) {
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(quantum));
  return std::bit_cast<float>((bits + 8) & ~std::uint32_t{15});
}

double side_of(std::uint16_t code) {
  return static_cast<double>(std::bit_cast<float>(std::uint32_t{code} << kTexelShift));
}

}  // namespace

LeafGrid leaf_grid(const Bounds3f& b) {
  // A float's own grain where the bounds lie far from zero.
  float largest = 1e-30f;
  for (int axis = 0; axis < 3; ++axis)
    largest = std::max({largest, std::abs(b.lo[axis]), std::abs(b.hi[axis]), b.extent()[axis]});
  return {b.lo, largest / kFrameSteps, largest / kBoxSteps};
}

double round_texel(double side) {
  const std::uint16_t below = texel_code(side);
  return side_of(below) >= side ? side_of(below) : side_of(static_cast<std::uint16_t>(below + 1));
}

std::uint16_t round_radius(float radius) {
  const std::uint16_t below = texel_code(static_cast<double>(radius));
  return unround_radius(below) >= radius ? below : static_cast<std::uint16_t>(below + 1);
}

void rotate_as_stored(Scan& mesh) {
  static_assert(sizeof(Triangle) == 3 * sizeof(unsigned int));
  auto* indices = reinterpret_cast<unsigned int*>(mesh.triangles.data());
  const std::size_t count = 3 * mesh.triangles.size();
  std::vector<unsigned char> bytes(meshopt_encodeIndexBufferBound(count, mesh.positions.size()));
  bytes.resize(meshopt_encodeIndexBuffer(bytes.data(), bytes.size(), indices, count));
  RBVH_CHECK(meshopt_decodeIndexBuffer(indices, count, sizeof(unsigned int), bytes.data(), bytes.size()) ==
             0);
}

float unround_radius(std::uint16_t code) { return static_cast<float>(side_of(code)); }

namespace {

RoundedFrame round_once(const LeafGrid& grid, const float m[12]) {
  RoundedFrame frame;
  Vec3d rows[3], corner{};
  double lengths[3];
  for (std::size_t i = 0; i < 3; ++i) {
    rows[i] = static_cast<Vec3d>(Vec3f{m[4 * i], m[4 * i + 1], m[4 * i + 2]});
    lengths[i] = length(rows[i]);
    corner = corner - rows[i] * (static_cast<double>(m[4 * i + 3]) / dot(rows[i], rows[i]));
    rows[i] = rows[i] * (1 / lengths[i]);
  }
  frame.is_left_handed = dot(cross(rows[0], rows[1]), rows[2]) < 0;
  if (frame.is_left_handed != 0) rows[2] = rows[2] * -1.0;
  std::array<double, 4> q = quaternion(rows);
  const auto largest = static_cast<std::size_t>(
      std::max_element(q.begin(), q.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }) -
      q.begin());
  frame.largest = static_cast<std::uint8_t>(largest);
  const double sign = q[largest] < 0 ? -1 : 1;
  for (std::size_t i = 0, k = 0; i < 4; ++i)
    if (i != largest)
      frame.rotation[k++] =
          static_cast<std::int16_t>(std::clamp(std::round(sign * q[i] * kRotationScale), -32767.0, 32767.0));
  for (int axis = 0; axis < 3; ++axis)
    frame.corner[static_cast<std::size_t>(axis)] = to_int(std::round(
        (corner[axis] - static_cast<double>(grid.origin[axis])) / static_cast<double>(grid.frame_step)));
  frame.texels = {texel_code((1 + kSideRounding) / lengths[0]), texel_code((1 + kSideRounding) / lengths[1])};
  frame.quantum = round_quantum(1 / lengths[2]);
  return frame;
}

}  // namespace

RoundedFrame round_frame(const LeafGrid& grid, const float m[12]) {
  // Where two parts of the quaternion are about the largest, what is read may round another way than what was
  // written. So until it does not; or, of two that round to each other, the one of the lower part.
  RoundedFrame frame = round_once(grid, m), before = frame;
  for (int i = 0; i < kMostRoundings; ++i) {
    float read[12];
    unround_frame(grid, frame, read);
    const RoundedFrame again = round_once(grid, read);
    if (again == frame) break;
    if (i > 0 && again == before) return again.largest < frame.largest ? again : frame;
    before = std::exchange(frame, again);
  }
  return frame;
}

void unround_frame(const LeafGrid& grid, const RoundedFrame& frame, float m[12]) {
  std::array<double, 4> q{};
  double rest = 1;
  for (std::size_t i = 0, k = 0; i < 4; ++i) {
    if (i == frame.largest) continue;
    q[i] = frame.rotation[k++] / kRotationScale;
    rest -= q[i] * q[i];
  }
  q[frame.largest & 3] = std::sqrt(std::max(rest, 0.0));
  Vec3d rows[3], corner;
  rows_of(q, rows);
  if (frame.is_left_handed != 0) rows[2] = rows[2] * -1.0;
  for (int axis = 0; axis < 3; ++axis)
    corner[axis] = static_cast<double>(grid.origin[axis]) +
                   frame.corner[static_cast<std::size_t>(axis)] * static_cast<double>(grid.frame_step);
  const double scales[3] = {1 / side_of(frame.texels[0]), 1 / side_of(frame.texels[1]),
                            1 / static_cast<double>(frame.quantum)};
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d row = rows[i] * scales[i];
    for (int axis = 0; axis < 3; ++axis)
      m[4 * i + static_cast<std::size_t>(axis)] = static_cast<float>(row[axis]);
    m[4 * i + 3] = static_cast<float>(-dot(row, corner));
  }
}

RoundedBox round_box(const LeafGrid& grid, const Bounds3f& box) {
  RoundedBox rounded;
  for (int axis = 0; axis < 3; ++axis) {
    const auto place = [&](float at) {
      return (static_cast<double>(at) - static_cast<double>(grid.origin[axis])) /
             static_cast<double>(grid.box_step);
    };
    const auto k = static_cast<std::size_t>(axis);
    rounded[k] = to_int(std::floor(place(box.lo[axis]) + kOnGrid));
    rounded[k + 3] = to_int(std::ceil(place(box.hi[axis]) - kOnGrid));
  }
  return rounded;
}

Bounds3f unround_box(const LeafGrid& grid, const RoundedBox& box) {
  Bounds3f result;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = [&](std::int32_t k) {
      return static_cast<float>(static_cast<double>(grid.origin[axis]) +
                                k * static_cast<double>(grid.box_step));
    };
    const auto k = static_cast<std::size_t>(axis);
    result.lo[axis] = at(box[k]);
    result.hi[axis] = at(box[k + 3]);
  }
  return result;
}

}  // namespace rbvh
