// What vectors are made of and multiplied by, beside include/rbvh/geometry.h.
#pragma once

#include <cmath>

#include "rbvh/geometry.h"

namespace rbvh {

/// Of what host and device share.
inline Vec3f array3(const float a[3]) { return {a[0], a[1], a[2]}; }

/// By component: of colours.
inline Vec3f times(Vec3f a, Vec3f b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

/// Two unit vectors at right angles to the unit vector `n` and to each other, as disc_frame() of
/// kernels/bvh/disc.h (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
inline void make_frame(Vec3f n, Vec3f& x, Vec3f& y) {
  const float sign = std::copysign(1.0f, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
  x = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
  y = {b, sign + n.y * n.y * a, -n.y};
}

}  // namespace rbvh
