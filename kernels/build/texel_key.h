// A texel of a tile that is being rasterised is one 32-bit key. An atomic maximum over the candidates picks
// the winner, so the result does not depend on their order:
//   bits 24..31  rank. 255: a primitive covers the texel's centre; 254 (near) .. 1 (two dilation radii away):
//                how far the nearest one ends; 0: only overlapping neighbours may claim the texel
//   bits 0..23   height in fine quanta; of equal ranks the highest along the tile's normal wins
// 0: nothing is there.
#ifndef RBVH_TEXEL_KEY_H
#define RBVH_TEXEL_KEY_H

#include "kernels/common/layout.h"

#define COVERED_RANK 255u

static inline uint key_rank(uint key) { return key >> 24; }
static inline uint key_height(uint key) { return key & 0xffffffu; }

// `distance` in texels; 0: covered. `rank_dilation`: the radius that ranks are scaled to, texels.
static inline uint rank_of(float distance, float rank_dilation) {
  return distance <= 0.0f ? COVERED_RANK : (uint)(254.0f - distance * (126.5f / rank_dilation));
}

static inline uint fine_height(float w) { return (uint)clamp(w, 0.0f, RBVH_FINE_MAX); }

static inline uint make_key(float distance, float rank_dilation, float w) {
  return (rank_of(distance, rank_dilation) << 24) | fine_height(w);
}

// An atomic maximum, skipped where it would change nothing: most would not.
static inline void raise(volatile __global uint* p, uint value) {
  if (*p < value) atomic_max(p, value);
}

#endif
