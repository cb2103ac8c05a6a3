// Boxes as the host's builders move them about: two vectors of four floats, which compilers keep in
// registers.
#pragma once

#include <bit>
#include <cstdint>

#include "pipeline/base/vec.h"

namespace rbvh {

/// Four floats that compilers keep in one register; the fourth is not used.
struct Lanes {
  alignas(16) float v[4];
};
inline Lanes lower(const Lanes& a, const Lanes& b) {
  Lanes r;
  for (int i = 0; i < 4; ++i) r.v[i] = b.v[i] < a.v[i] ? b.v[i] : a.v[i];
  return r;
}
inline Lanes upper(const Lanes& a, const Lanes& b) {
  Lanes r;
  for (int i = 0; i < 4; ++i) r.v[i] = b.v[i] > a.v[i] ? b.v[i] : a.v[i];
  return r;
}

/// Empty until something is added.
struct Box {
  Lanes lo{{3e38f, 3e38f, 3e38f, 0}}, hi{{-3e38f, -3e38f, -3e38f, 0}};

  void add(const Box& b) {
    lo = lower(lo, b.lo);
    hi = upper(hi, b.hi);
  }
  void add_point(const Lanes& p) {
    lo = lower(lo, p);
    hi = upper(hi, p);
  }
  float half_area() const {
    const float x = hi.v[0] - lo.v[0], y = hi.v[1] - lo.v[1], z = hi.v[2] - lo.v[2];
    return x * y + y * z + z * x;
  }
  Bounds3f bounds() const { return {{lo.v[0], lo.v[1], lo.v[2]}, {hi.v[0], hi.v[1], hi.v[2]}}; }
};

/// An element: its box, and its index in the unused lane, so that it moves as one cache line's half.
struct Element {
  Box box;

  static Element make(const Bounds3f& b, std::uint32_t index) {
    return {{{{b.lo.x, b.lo.y, b.lo.z, 0}}, {{b.hi.x, b.hi.y, b.hi.z, std::bit_cast<float>(index)}}}};
  }
  std::uint32_t index() const { return std::bit_cast<std::uint32_t>(box.hi.v[3]); }
  /// Twice the centre.
  Lanes center() const {
    Lanes c;
    for (int i = 0; i < 4; ++i) c.v[i] = box.lo.v[i] + (i < 3 ? box.hi.v[i] : 0.0f);
    return c;
  }
};

}  // namespace rbvh
