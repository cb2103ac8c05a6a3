// What a ray found that found nothing.
#ifndef RBVH_NO_HIT_H
#define RBVH_NO_HIT_H
#include "kernels/common/layout.h"

static inline Hit no_hit(void) {
  Hit hit;
  hit.t = INFINITY;
  hit.normal[0] = hit.normal[1] = hit.normal[2] = 0.0f;
  hit.u = hit.v = 0.0f;
  hit.leaf = RBVH_NO_LEAF;
  hit.flags = 0;
  return hit;
}
#endif
