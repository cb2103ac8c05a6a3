// One level of the breadth-first construction (section 6 of the paper): every active node's references are
// split in two by its plane. References of a node are contiguous and stay so, hence the paper's sort by node
// is a stable partition inside each node, and no reference is ever duplicated.
#include "kernels/common/layout.h"

#pragma OPENCL FP_CONTRACT OFF

typedef struct {
  float4 lo, hi, area_normal;
  uint count;
} Sums;

static inline Sums no_sums(void) {
  Sums s;
  s.lo = (float4)(FLT_MAX, FLT_MAX, FLT_MAX, 0.0f);
  s.hi = (float4)(-FLT_MAX);
  s.area_normal = (float4)(0.0f);
  s.count = 0;
  return s;
}

// box_lo.w is the area: it is summed, not minimised.
static inline void sums_add(Sums* s, float4 lo, float4 hi, float4 area_normal) {
  const float area = s->lo.w + lo.w;
  s->lo = min(s->lo, lo);
  s->lo.w = area;
  s->hi = max(s->hi, hi);
  s->area_normal += area_normal;
  s->count++;
}

static inline void sums_store(const Sums* s, __global PrimitiveSums* out) {
  vstore3(s->lo.xyz, 0, out->lo);
  out->count = s->count;
  vstore3(s->hi.xyz, 0, out->hi);
  out->area = s->lo.w;
  vstore3(s->area_normal.xyz, 0, out->area_normal);
  out->boundary = s->area_normal.w;
}

__kernel void partition_reduce(__global const Run* runs, uint run_count, __global const uint* references,
                               __global const float4* box_lo, __global const float4* box_hi,
                               __global const float4* area_normal, __global PrimitiveSums* sums) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  Sums s = no_sums();
  for (uint i = runs[r].begin; i < end; ++i) {
    const uint j = references[i];
    sums_add(&s, box_lo[j], box_hi[j], area_normal[j]);
  }
  sums_store(&s, sums + r);
}

// Chooses each reference's side and sums the two children over this run: sums[2r] left, sums[2r + 1] right.
__kernel void partition_choose(__global const Run* runs, uint run_count, __global const Split* splits,
                               __global const uint* references, __global const float4* box_lo,
                               __global const float4* box_hi, __global const float4* area_normal,
                               __global const uint* objects, __global uchar* sides,
                               __global PrimitiveSums* sums) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint begin = runs[r].begin, end = runs[r].end;
  const Split split = splits[runs[r].owner];
  const float4 direction = (float4)(vload3(0, split.direction), 0.0f);
  Sums left = no_sums(), right = no_sums();
  for (uint i = begin; i < end; ++i) {
    const uint j = references[i];
    const float4 lo = box_lo[j], hi = box_hi[j], n = area_normal[j];
    const bool is_left = split.kind == RBVH_SPLIT_PLANE ? 0.5f * dot(lo + hi, direction) < split.position
                         : split.kind == RBVH_SPLIT_FACING
                             ? dot(n, direction) >= split.position * length(n.xyz)
                         : split.kind == RBVH_SPLIT_OBJECT   ? objects[j] == split.middle
                         : split.kind == RBVH_SPLIT_BOUNDARY ? n.w != 0.0f
                                                             : i < split.middle;
    sides[i] = is_left ? 0 : 1;
    if (is_left)
      sums_add(&left, lo, hi, n);
    else
      sums_add(&right, lo, hi, n);
  }
  sums_store(&left, sums + 2 * r);
  sums_store(&right, sums + 2 * r + 1);
}

// Moves references to their side, in order. This run's left and right ones begin at targets[2r] and
// targets[2r + 1].
__kernel void partition_scatter(__global const Run* runs, uint run_count, __global const uint* targets,
                                __global const uint* references, __global const uchar* sides,
                                __global uint* moved) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  uint at[2] = {targets[2 * r], targets[2 * r + 1]};
  for (uint i = runs[r].begin; i < end; ++i) moved[at[sides[i]]++] = references[i];
}

__kernel void partition_copy(__global const Run* runs, uint run_count, __global const uint* from,
                             __global uint* to) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  for (uint i = runs[r].begin; i < end; ++i) to[i] = from[i];
}

// The cone of normals (second pass over the primitives): per run, the smallest cosine between a primitive's
// normal and its node's mean normal. Primitives without area are skipped.
__kernel void partition_cones(__global const Run* runs, uint run_count, __global const float4* axes,
                              __global const uint* references, __global const float4* area_normal,
                              __global float* cosines) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  const float4 axis = axes[runs[r].owner];
  float least = 1.0f;
  for (uint i = runs[r].begin; i < end; ++i) {
    float4 n = area_normal[references[i]];
    n.w = 0.0f;
    const float size = length(n);
    if (size > 0.0f) least = min(least, dot(n, axis) / size);
  }
  cosines[r] = least;
}

// The surface area heuristic's bins (section 3.2 of the paper): per run and axis, the bounds and area between
// two candidate planes.
__kernel void partition_bins(__global const Run* runs, uint run_count, __global const SplitGrid* grids,
                             __global const uint* references, __global const float4* box_lo,
                             __global const float4* box_hi, __global SplitBin* bins) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  const SplitGrid grid = grids[runs[r].owner];
  for (int axis = 0; axis < 3; ++axis) {
    float4 lo[RBVH_SAH_BINS], hi[RBVH_SAH_BINS];
    uint counts[RBVH_SAH_BINS];
    for (int b = 0; b < RBVH_SAH_BINS; ++b) {
      lo[b] = (float4)(FLT_MAX, FLT_MAX, FLT_MAX, 0.0f);
      hi[b] = (float4)(-FLT_MAX);
      counts[b] = 0;
    }
    const float4 pick = (float4)(axis == 0, axis == 1, axis == 2, 0);
    const float from = grid.lo[axis], scale = grid.scale[axis];
    for (uint i = runs[r].begin; i < end; ++i) {
      const uint j = references[i];
      const float4 a = box_lo[j], b = box_hi[j];
      const int bin = clamp((int)((0.5f * dot(a + b, pick) - from) * scale), 0, RBVH_SAH_BINS - 1);
      const float area = lo[bin].w + a.w;
      lo[bin] = min(lo[bin], a);
      lo[bin].w = area;
      hi[bin] = max(hi[bin], b);
      counts[bin]++;
    }
    __global SplitBin* out = bins + ((size_t)r * 3 + axis) * RBVH_SAH_BINS;
    for (int b = 0; b < RBVH_SAH_BINS; ++b) {
      vstore3(lo[b].xyz, 0, out[b].lo);
      vstore3(hi[b].xyz, 0, out[b].hi);
      out[b].area = lo[b].w;
      out[b].count = counts[b];
    }
  }
}

__kernel void partition_objects(__global const Run* runs, uint run_count, __global const uint* references,
                                __global const uint* objects, __global ObjectSet* sets) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint begin = runs[r].begin, end = runs[r].end;
  ObjectSet set;
  set.ids[0] = set.ids[1] = objects[references[begin]];
  set.count = 1;
  for (uint i = begin + 1; i < end; ++i) {
    const uint id = objects[references[i]];
    if (id == set.ids[0] || (set.count >= 2 && id == set.ids[1])) continue;
    if (set.count == 1) set.ids[1] = id;
    set.count = min(set.count + 1u, 3u);
  }
  sets[r] = set;
}
