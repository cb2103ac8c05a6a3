// A tile's own primitives become heights: the paper's section 3.3.
#include "kernels/build/tile_primitive.h"

#pragma OPENCL FP_CONTRACT OFF

// keys: the winners (texel_key.h). lowest, highest: of the heights that cover the texel's centre, to find two
// layers; kept as RBVH_FINE_MAX - w and w, each plus one, so that both are maxima and 0 means none.
__kernel void rasterize_own(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                            __global const uint* references, __global const float* shape, uint is_disc,
                            float dilation, float rank_dilation, __global uint* keys, __global uint* lowest,
                            __global uint* highest, __global TileFaults* faults) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  uint back = 0;
  float steep = 0.0f;
  for (uint i = runs[r].begin; i < end; ++i) {
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)references[i], is_disc, dilation);
    steep += p.steep;
    FOR_EACH_TEXEL(p) {
      const uint at = tile->offset + (uint)y * tile->width + (uint)x;
      if (!may_win(&p, x, y, keys[at], rank_dilation)) continue;
      const Sample q = sample_primitive(&p, x, y, dilation);
      if (q.distance < 0.0f) continue;
      raise(keys + at, make_key(q.distance, rank_dilation, q.w));
      if (q.distance != 0.0f) continue;
      raise(lowest + at, (uint)RBVH_FINE_MAX - fine_height(q.w) + 1u);
      raise(highest + at, fine_height(q.w) + 1u);
      back += p.is_back;
    }
  }
  if (back != 0) atomic_add(&faults[runs[r].owner].backs, back);
  if (steep != 0.0f) atomic_add(&faults[runs[r].owner].steep, (uint)min(steep * 16.0f, 1e6f));
}
