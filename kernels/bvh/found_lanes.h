// The nearest hits so far of sixteen rays, as Found.
#ifndef RBVH_FOUND_LANES_H
#define RBVH_FOUND_LANES_H
#include "kernels/bvh/prepared_ray.h"

typedef struct Found16 {
  float16 t, u, v;
  uint16 id, at;
} Found16;

static ALWAYS_INLINE void take_lanes(int16 taken, float16 t, float16 u, float16 v, uint id, uint at,
                                     Found16* found) {
  found->t = select(found->t, t, taken);
  found->u = select(found->u, u, taken);
  found->v = select(found->v, v, taken);
  found->id = select(found->id, (uint16)(id), taken);
  found->at = select(found->at, (uint16)(at), taken);
}

// is_nearer() by lane.
static ALWAYS_INLINE int16 is_nearer_packet(float16 t, uint id, const Found16* found) {
  return (t < found->t) | ((t == found->t) & ((uint16)(id) < found->id));
}
#endif
