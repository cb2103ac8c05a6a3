// What every traversal begins with: the prepared ray, and the nearest hit so far.
//
// Planes and boxes are tested with the origin moved by an error bound, so that no box is missed whose
// triangle the watertight test (triangle.h) would accept. Hence all traversals find the same hits, to the
// last bit.
//
// The rule for every hit: it counts where tmin <= t <= tmax, and of equally near ones the lowest index wins,
// so that the result does not depend on the hierarchy or on the order of the traversal.
#ifndef RBVH_PREPARED_RAY_H
#define RBVH_PREPARED_RAY_H
#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/lanes.h"
#include "kernels/common/layout.h"

#pragma OPENCL FP_CONTRACT OFF
#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

// The nearest hit so far.
typedef struct Found {
  float t;
  float u, v;
  uint id;  // of the primitive or tile; RBVH_NO_LEAF: nothing
  uint at;  // where the primitive lies
} Found;

static inline float limit_of(const Found* found) { return found->t; }

// A ray, with what the tests of boxes and triangles need of it; 32 words, which prepared_rays_of() writes by
// fours.
typedef struct PreparedRay {
  float origin[3], direction[3];
  float tmin;
  uint kx, ky, kz;   // kz: the axis along which the direction is longest
  float ox, oy, oz;  // the origin along these
  float sx, sy, sz;  // shear
  float inverse[3];
  // t of a plane along an axis = plane * inverse + offset, moved before or behind it by the error bound.
  float near_offset[3], far_offset[3];
  uint near_row[3], far_row[3];  // of planes in the order lo x y z, hi x y z
  uint unused;
} PreparedRay;

// By how much boxes are widened for rays from `origin`. Rounding in the triangle test moves vertices by at
// most 5 * 2^-24 of the distances along two axes, rounding in the box test by 3 * 2^-24 of the coordinates:
// together less than this.
static inline float error_bound(const float* origin, const BvhRoot* scene) {
  float farthest = 0.0f;
#pragma unroll
  for (uint i = 0; i < 3; ++i) {
    const float o = origin[i];
    farthest = max(farthest, max(fabs(scene->lo[i] - o), fabs(scene->hi[i] - o)));
    farthest = max(farthest, fabs(o));
  }
  return 1.2e-6f * farthest;
}

// False where the ray cannot hit anything: not finite, without a direction or an interval.
static ALWAYS_INLINE bool prepare(const Ray* ray, const BvhRoot* scene, PreparedRay* q) {
  float longest = 0.0f;
  bool finite = ray->tmin <= ray->tmax;
  q->kz = 0;
#pragma unroll
  for (uint i = 0; i < 3; ++i) {
    const float o = ray->origin[i], d = ray->direction[i];
    finite = finite && isfinite(o) && isfinite(d);
    q->origin[i] = o;
    q->direction[i] = d;
    if (fabs(d) > longest) {
      longest = fabs(d);
      q->kz = i;
    }
  }
  if (!finite || !(longest > 0.0f)) return false;
  q->tmin = ray->tmin;
  q->kx = (q->kz + 1) % 3;
  q->ky = (q->kz + 2) % 3;
  q->ox = q->origin[q->kx];
  q->oy = q->origin[q->ky];
  q->oz = q->origin[q->kz];
  q->sx = q->direction[q->kx] / q->direction[q->kz];
  q->sy = q->direction[q->ky] / q->direction[q->kz];
  q->sz = 1.0f / q->direction[q->kz];
  const float margin = error_bound(q->origin, scene);
#pragma unroll
  for (uint i = 0; i < 3; ++i) {
    const float d = q->direction[i];
    const float parallel_limit = 1e-18f * longest;
    // A ray parallel to a slab crosses its planes far away, before or behind the origin as the margin
    // decides.
    const float inverse = fabs(d) > parallel_limit ? 1.0f / d : copysign(1e18f / longest, d);
    const float outwards = copysign(margin, inverse);
    q->inverse[i] = inverse;
    q->near_offset[i] = -(q->origin[i] + outwards) * inverse;
    q->far_offset[i] = -(q->origin[i] - outwards) * inverse;
    q->near_row[i] = inverse < 0.0f ? i + 3 : i;
    q->far_row[i] = inverse < 0.0f ? i : i + 3;
  }
  return true;
}

// The tie rule (see above).
static inline bool is_nearer(float t, uint id, const Found* found) {
  return t < found->t || (t == found->t && id < found->id);
}

static inline float3 triangle_normal(float3 a, float3 b, float3 c) {
  const float3 ab = b - a, ac = c - a;
  // Scaled first: the product of small edges would vanish.
  const float3 e = max(fabs(ab), fabs(ac));
  const float scale = 1.0f / max(e.x, max(e.y, e.z));
  return normalize(cross(ab * scale, ac * scale));
}
#endif
