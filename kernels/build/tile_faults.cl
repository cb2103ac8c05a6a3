// Where a tile is a poor fit for its own primitives: layers, depth steps, corners far from the heights, and
// triangles that no ray can find in it.
#include "kernels/build/tile_primitive.h"

#pragma OPENCL FP_CONTRACT OFF

// `layer_gap`, `step_limit`: in texels. `middles`: the mean height halfway between two layers, fine quanta.
__kernel void tile_faults_steps(__global const RasterTile* tiles, uint tile_count, __global const uint* keys,
                                __global const uint* lowest, __global const uint* highest, float layer_gap,
                                float step_limit, __global TileFaults* faults, __global float* middles) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const RasterTile tile = tiles[k];
  uint layered = 0, steps = 0;
  float middle = 0.0f;
  const float gap = layer_gap * tile.texel_w, step = step_limit * tile.texel_w;
  for (uint y = 0; y < tile.height; ++y)
    for (uint x = 0; x < tile.width; ++x) {
      const uint at = tile.offset + y * tile.width + x;
      const uint key = keys[at];
      if (key == 0) continue;
      const float w = (float)key_height(key);
      const float top = (float)(highest[at] - 1u), bottom = RBVH_FINE_MAX - (float)(lowest[at] - 1u);
      if (highest[at] != 0 && top - bottom > gap) {
        layered++;
        middle += 0.5f * (top + bottom);
      }
      const uint right = x + 1 < tile.width ? keys[at + 1] : 0,
                 below = y + 1 < tile.height ? keys[at + tile.width] : 0;
      if (right != 0 && fabs((float)key_height(right) - w) > step) steps++;
      if (below != 0 && fabs((float)key_height(below) - w) > step) steps++;
    }
  faults[k].layered = layered;
  middles[k] = layered != 0 ? middle / (float)layered : 0.0f;
  faults[k].steps = steps;
}

// Corners of triangles further than `miss_limit` texels from the bilinear heights that rays are intersected
// with.
__kernel void tile_faults_misses(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                                 __global const uint* references, __global const float* shape,
                                 float miss_limit, __global const uint* keys, __global TileFaults* faults) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  const float limit = miss_limit * tile->texel_w;
  uint misses = 0;
  for (uint i = runs[r].begin; i < end; ++i)
    for (uint k = 0; k < 3; ++k) {
      const float4 p = to_tile(tile->to_tile, load3(shape + 9 * (size_t)references[i], k));
      const uint x = min((uint)max(p.x, 0.0f), tile->width - 2),
                 y = min((uint)max(p.y, 0.0f), tile->height - 2);
      __global const uint* q = keys + tile->offset + y * tile->width + x;
      const uint a = q[0], b = q[1], c = q[tile->width], d = q[tile->width + 1];
      if (a == 0 || b == 0 || c == 0 || d == 0) continue;
      const float fu = p.x - (float)x, fv = p.y - (float)y;
      const float h0 = mix((float)key_height(a), (float)key_height(b), fu),
                  h1 = mix((float)key_height(c), (float)key_height(d), fu);
      misses += fabs(mix(h0, h1, fv) - p.z) > limit;
    }
  if (misses != 0) atomic_add(&faults[runs[r].owner].misses, misses);
}

// Uncovered triangles: those that extend further than `slack` texels into a cell with an empty corner, where
// no ray finds them. `list`: their places among `references`, in no order, after their number in list[0];
// those that are more than `room` are counted only.
__kernel void tile_faults_uncovered(__global const Run* runs, uint run_count,
                                    __global const RasterTile* tiles, __global const uint* references,
                                    __global const float* shape, float slack, __global const uint* keys,
                                    uint room, __global uint* list) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  for (uint i = runs[r].begin; i < end; ++i) {
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)references[i], 0, 0.0f);
    const uint x1 = min(tile->width - 2, (uint)p.hi.x), y1 = min(tile->height - 2, (uint)p.hi.y);
    bool is_uncovered = false;
    for (uint y = (uint)max(p.lo.y, 0.0f); y <= y1; ++y)
      for (uint x = (uint)max(p.lo.x, 0.0f); x <= x1; ++x) {
        __global const uint* q = keys + tile->offset + y * tile->width + x;
        if (q[0] != 0 && q[1] != 0 && q[tile->width] != 0 && q[tile->width + 1] != 0) continue;
        const float2 middle = (float2)((float)x + 0.5f, (float)y + 0.5f);
        is_uncovered |= sample_triangle(&p.triangle, middle, 0.5f - slack).distance >= 0.0f;
      }
    if (!is_uncovered) continue;
    const uint at = atomic_inc(list);
    if (at < room) list[1 + at] = i;
  }
}
