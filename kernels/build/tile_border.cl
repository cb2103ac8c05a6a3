// A tile's border: where its own primitives end, the primitives of overlapping neighbours tell how the
// surface goes on, so that neighbouring tiles agree on the surface between them.
#include "kernels/build/tile_primitive.h"

#pragma OPENCL FP_CONTRACT OFF

// Lets neighbours claim the texels next to the tile's own: rank 0, at the height of the highest-ranked own
// texel.
__kernel void tile_border_widen(__global const RasterTile* tiles, uint tile_count, __global uint* keys) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const RasterTile tile = tiles[k];
  for (uint y = 0; y < tile.height; ++y)
    for (uint x = 0; x < tile.width; ++x) {
      const uint at = tile.offset + y * tile.width + x;
      if (keys[at] != 0) continue;
      uint best = 0;
      for (uint v = max(y, 1u) - 1; v <= min(y + 1, tile.height - 1); ++v)
        for (uint u = max(x, 1u) - 1; u <= min(x + 1, tile.width - 1); ++u)
          best = max(best, keys[tile.offset + v * tile.width + u]);
      if (key_rank(best) != 0) keys[at] = max(key_height(best), 1u);
    }
}

// Rasterises overlapping neighbours over the texels that the tile's own primitives or the widening reached.
// The same surface, within `gap` texels of the tile's own height, competes as own primitives do; any other
// only marks that the surface does not end there (key 1). A primitive on a boundary edge of the scan is
// dilated by `boundary_distance` texels only, unless it faces away or is steep.
__kernel void tile_border_overlaps(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                                   __global const uint* overlaps, __global const float* shape, uint is_disc,
                                   __global const float4* area_normal, float boundary_distance,
                                   float dilation, float gap, __global const uint* keys,
                                   __global uint* overlap_keys) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  for (uint i = runs[r].begin; i < end; ++i) {
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)overlaps[i], is_disc, dilation);
    const bool faces = !p.is_back && !p.flat && p.steep == 0.0f;
    const float most = faces && area_normal[overlaps[i]].w != 0.0f ? boundary_distance : 2.0f * dilation;
    FOR_EACH_TEXEL(p) {
      const uint at = tile->offset + (uint)y * tile->width + (uint)x;
      if (keys[at] == 0 || !may_win(&p, x, y, overlap_keys[at], dilation)) continue;
      if (key_rank(keys[at]) == COVERED_RANK && !may_win(&p, x, y, keys[at], dilation)) continue;
      const Sample q = sample_primitive(&p, x, y, dilation);
      if (q.distance < 0.0f || q.distance > most) continue;
      const float own = (float)key_height(keys[at]);
      const bool same = faces && fabs(q.w - own) <= gap * tile->texel_w;
      raise(overlap_keys + at, same ? make_key(q.distance, dilation, q.w) : 1u);
    }
  }
}

// A neighbour takes the texels that it is nearer to. Where nothing covers a texel's centre, the surface folds
// away (a neighbour is there) or ends (none is), and texels further than `fold_dilation` or `end_dilation`
// from it are dropped. A tile that covers no centre at all keeps what is within 0.75 texel, so that it does
// not fall between the texels: no point is further than 0.71 from one.
__kernel void tile_border_merge(__global const RasterTile* tiles, uint tile_count, __global uint* keys,
                                __global const uint* overlap_keys, float dilation, float fold_dilation,
                                float end_dilation) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const uint begin = tiles[k].offset, end = begin + tiles[k].width * tiles[k].height;
  uint highest = 0;
  for (uint at = begin; at < end; ++at) highest = max(highest, keys[at]);
  const uint least = highest < make_key(0.0f, dilation, 0.0f) ? make_key(0.75f, dilation, 0.0f) : UINT_MAX;
  const uint at_fold = min(least, make_key(fold_dilation, dilation, 0.0f)),
             at_end = min(least, make_key(end_dilation, dilation, 0.0f));
  for (uint at = begin; at < end; ++at) {
    const uint own = keys[at], overlap = overlap_keys[at];
    const uint key = key_rank(own) < key_rank(overlap) ? overlap : own;
    keys[at] = key < (overlap == 0 ? at_end : at_fold) ? 0 : key;
  }
}
