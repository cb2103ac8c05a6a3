// The extents of a tile's primitives in its plane at RBVH_FRAME_ANGLES angles about its normal: the host
// takes the angle of the smallest rectangle.
#include "kernels/build/load3.h"
#include "kernels/common/layout.h"

#pragma OPENCL FP_CONTRACT OFF

// cos and sin of RBVH_FRAME_ANGLES angles in [0, 90) degrees.
__constant float frame_cos[16] = {
    1.0f,        0.99518473f, 0.98078528f, 0.95694034f, 0.92387953f, 0.88192126f, 0.83146961f, 0.77301045f,
    0.70710678f, 0.63439328f, 0.55557023f, 0.47139674f, 0.38268343f, 0.29028468f, 0.19509032f, 0.09801714f};
__constant float frame_sin[16] = {
    0.0f,        0.09801714f, 0.19509032f, 0.29028468f, 0.38268343f, 0.47139674f, 0.55557023f, 0.63439328f,
    0.70710678f, 0.77301045f, 0.83146961f, 0.88192126f, 0.92387953f, 0.95694034f, 0.98078528f, 0.99518473f};

typedef struct {
  float16 u_lo, u_hi, v_lo, v_hi;
  float w_lo, w_hi;
} Extents;

// A ball of radius_uv in the plane and radius_w across it.
static inline void extents_add(Extents* e, float u, float v, float w, float radius_uv, float radius_w) {
  const float16 c = vload16(0, frame_cos), s = vload16(0, frame_sin);
  const float16 ru = c * u + s * v, rv = c * v - s * u;
  e->u_lo = min(e->u_lo, ru - radius_uv);
  e->u_hi = max(e->u_hi, ru + radius_uv);
  e->v_lo = min(e->v_lo, rv - radius_uv);
  e->v_hi = max(e->v_hi, rv + radius_uv);
  e->w_lo = min(e->w_lo, w - radius_w);
  e->w_hi = max(e->w_hi, w + radius_w);
}

__kernel void tile_frame_extents(__global const Run* runs, uint run_count, __global const TileAxes* axes,
                                 __global const uint* references, __global const float* shape, uint is_disc,
                                 __global TileExtents* extents) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const TileAxes* a = axes + runs[r].owner;
  const float4 o = vload4(0, a->origin), u = vload4(0, a->u), v = vload4(0, a->v), w = vload4(0, a->w);
  Extents e;
  e.u_lo = e.v_lo = (float16)(FLT_MAX);
  e.u_hi = e.v_hi = (float16)(-FLT_MAX);
  e.w_lo = FLT_MAX;
  e.w_hi = -FLT_MAX;
  for (uint i = runs[r].begin; i < end; ++i) {
    __global const float* s = shape + 9 * (size_t)references[i];
    if (is_disc) {
      const float4 p = load3(s, 0) - o;
      const float cosine = dot((float4)(s[4], s[5], s[6], 0.0f), w);
      extents_add(&e, dot(p, u), dot(p, v), dot(p, w), s[3], s[3] * sqrt(max(0.0f, 1.0f - cosine * cosine)));
    } else {
      for (uint k = 0; k < 3; ++k) {
        const float4 p = load3(s, k) - o;
        extents_add(&e, dot(p, u), dot(p, v), dot(p, w), 0.0f, 0.0f);
      }
    }
  }
  __global TileExtents* out = extents + r;
  vstore16(e.u_lo, 0, out->u_lo);
  vstore16(e.u_hi, 0, out->u_hi);
  vstore16(e.v_lo, 0, out->v_lo);
  vstore16(e.v_hi, 0, out->v_hi);
  out->w_lo = e.w_lo;
  out->w_hi = e.w_hi;
}
