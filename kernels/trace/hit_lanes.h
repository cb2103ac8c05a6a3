// Sixteen hits side by side, a number of theirs a vector, until they are written one after the other.
#ifndef RBVH_HIT_LANES_H
#define RBVH_HIT_LANES_H
#include "kernels/bvh/found_lanes.h"

typedef struct HitLanes {
  float16 t, normal[3], u, v;
  uint16 leaf, flags;
} HitLanes;

// no_hit() in each.
static ALWAYS_INLINE void no_hits(HitLanes* h) {
  h->t = INFINITY;
  h->normal[0] = h->normal[1] = h->normal[2] = 0.0f;
  h->u = h->v = 0.0f;
  h->leaf = RBVH_NO_LEAF;
  h->flags = 0;
}

// Pairs of two rows' elements, then of pairs: within 128 bits, as wide vector units shuffle fastest.
#define UNPACK_LO(a, b) \
  (float16)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5, a.s8, b.s8, a.s9, b.s9, a.sc, b.sc, a.sd, b.sd)
#define UNPACK_HI(a, b) \
  (float16)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7, a.sa, b.sa, a.sb, b.sb, a.se, b.se, a.sf, b.sf)
#define PAIRS_LO(a, b) (float16)(a.s01, b.s01, a.s45, b.s45, a.s89, b.s89, a.scd, b.scd)
#define PAIRS_HI(a, b) (float16)(a.s23, b.s23, a.s67, b.s67, a.sab, b.sab, a.sef, b.sef)

static ALWAYS_INLINE void store_hits(const HitLanes* h, Hit* hits) {
  const float16 leaf = as_float16(h->leaf), flags = as_float16(h->flags);
  const float16 *n = h->normal, rows[2][4] = {{h->t, n[0], n[1], n[2]}, {h->u, h->v, leaf, flags}};
  for (uint part = 0; part < 2; ++part) {
    const float16* r = rows[part];
    const float16 ab_lo = UNPACK_LO(r[0], r[1]), ab_hi = UNPACK_HI(r[0], r[1]);
    const float16 cd_lo = UNPACK_LO(r[2], r[3]), cd_hi = UNPACK_HI(r[2], r[3]);
    const float16 quads[4] = {PAIRS_LO(ab_lo, cd_lo), PAIRS_HI(ab_lo, cd_lo), PAIRS_LO(ab_hi, cd_hi),
                              PAIRS_HI(ab_hi, cd_hi)};
    float* to = (float*)hits + 4 * part;
    for (uint k = 0; k < 4; ++k) {
      vstore4(quads[k].s0123, 2 * k, to);
      vstore4(quads[k].s4567, 2 * (k + 4), to);
      vstore4(quads[k].s89ab, 2 * (k + 8), to);
      vstore4(quads[k].scdef, 2 * (k + 12), to);
    }
  }
}
#endif
