// The nearest few targets that a ray reaches in one round, in the order of (t, id), and where it goes on in
// the next. MOST: targets a ray and round.
#ifndef RBVH_NEAREST_FEW_H
#define RBVH_NEAREST_FEW_H
#include "kernels/common/ray_queue_layout.h"

typedef struct Candidate {
  float t;  // where the ray enters it
  uint id;
} Candidate;

typedef struct NearestFew {
  RayProgress after;            // targets entered before are done with
  Candidate nearest[MOST + 1];  // one more than are taken: it tells whether and where the ray goes on
  uint count, most;
} NearestFew;

// Targets entered beyond this t are not among the nearest few. `limit`: t of the ray's nearest hit.
static inline float few_limit(const NearestFew* few, float limit) {
  return few->count > few->most ? min(limit, few->nearest[few->most].t) : limit;
}

static inline bool is_done_with(const NearestFew* few, float t, uint id) {
  return t < few->after.t || (t == few->after.t && id <= few->after.id);
}

static inline void add_candidate(NearestFew* few, float t, uint id) {
  if (few->count > few->most) {
    const Candidate last = few->nearest[few->most];
    if (t > last.t || (t == last.t && id > last.id)) return;
    --few->count;
  }
  uint at = few->count++;
  for (; at > 0 &&
         (few->nearest[at - 1].t > t || (few->nearest[at - 1].t == t && few->nearest[at - 1].id > id));
       --at)
    few->nearest[at] = few->nearest[at - 1];
  few->nearest[at].t = t;
  few->nearest[at].id = id;
}

// After the last candidate: drops those beyond `limit`. Returns how many to take.
static inline uint finish_candidates(NearestFew* few, float limit) {
  while (few->count > 0 && few->nearest[few->count - 1].t > limit) --few->count;
  return min(few->count, few->most);
}

static inline RayProgress progress_of(const NearestFew* few) {
  RayProgress done = {INFINITY, 0xffffffffu, INFINITY};
  if (few->count > few->most) {
    done.t = few->nearest[few->most - 1].t;
    done.id = few->nearest[few->most - 1].id;
    done.next_t = few->nearest[few->most].t;
  }
  return done;
}

static inline RayProgress no_progress(void) {
  const RayProgress start = {-INFINITY, 0u, -INFINITY};
  return start;
}
#endif
