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

// The different ones among the lanes of `which`, in the order of their first lanes, and their number. `slot`:
// which of them each lane is.
static ALWAYS_INLINE uint list_different(uint16 lanes, uint which, uint* different, int16* slot) {
  uint all[16], count = 0;
  vstore16(lanes, 0, all);
  *slot = 0;
  for (uint left = which; left != 0; ++count) {
    const uint value = all[lowest_bit(left)];
    const int16 alike = lanes == value;
    different[count] = value;
    *slot = select(*slot, (int16)((int)count), alike);
    left &= ~lane_bits16(alike);
  }
  return count;
}

static ALWAYS_INLINE void store_hits(const HitLanes* h, Hit* hits) {
  const float16 *n = h->normal, rows[2][4] = {{h->t, n[0], n[1], n[2]},
                                              {h->u, h->v, as_float16(h->leaf), as_float16(h->flags)}};
  for (uint part = 0; part < 2; ++part)
    store_transposed4(rows[part], sizeof(Hit) / sizeof(float), (float*)hits + 4 * part);
}
#endif
