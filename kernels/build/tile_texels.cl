// From keys to what is stored: 16-bit heights over each tile's range, normals and colours.
#include "kernels/build/pack_signals.h"
#include "kernels/build/tile_primitive.h"

#pragma OPENCL FP_CONTRACT OFF

__kernel void tile_texels_range(__global const RasterTile* tiles, uint tile_count, __global const uint* keys,
                                __global TileRange* ranges) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const uint begin = tiles[k].offset, end = begin + tiles[k].width * tiles[k].height;
  TileRange range;
  range.lo = 0xffffffffu;
  range.hi = range.used = 0;
  for (uint at = begin; at < end; ++at) {
    const uint key = keys[at];
    if (key == 0) continue;
    const uint w = key_height(key);
    range.lo = min(range.lo, w);
    range.hi = max(range.hi, w);
    range.used++;
  }
  ranges[k] = range;
}

// 1 + round((w - base) * scale); 0: no surface.
__kernel void tile_texels_quantize(__global const RasterTile* tiles, uint tile_count,
                                   __global const uint* bases, __global const float* scales,
                                   __global const uint* keys, __global ushort* heights) {
  const uint k = get_global_id(0);
  if (k >= tile_count) return;
  const uint begin = tiles[k].offset, end = begin + tiles[k].width * tiles[k].height;
  for (uint at = begin; at < end; ++at) {
    const uint key = keys[at];
    heights[at] = key == 0 ? 0 : (ushort)(1.5f + ((float)(key_height(key) - bases[k])) * scales[k]);
  }
}

// Rasterises the same triangles again: those whose key won give the texel their normal (and colour),
// interpolated at its centre. Of equal keys the largest value wins, so the order does not matter here either.
__kernel void tile_texels_signals(__global const Run* runs, uint run_count, __global const RasterTile* tiles,
                                  __global const uint* references, __global const float* shape,
                                  float dilation, float rank_dilation, __global const uint* keys,
                                  __global const uint* order, __global const uint* indices,
                                  __global const float* normals, __global const uint* colors, uint has_colors,
                                  __global uint* texel_normals, __global uint* texel_colors) {
  const uint r = get_global_id(0);
  if (r >= run_count) return;
  const uint end = runs[r].end;
  __global const RasterTile* tile = tiles + runs[r].owner;
  for (uint i = runs[r].begin; i < end; ++i) {
    const uint j = references[i];
    const TilePrimitive p = make_primitive(tile, shape + 9 * (size_t)j, 0, dilation);
    FOR_EACH_TEXEL(p) {
      const uint at = tile->offset + (uint)y * tile->width + (uint)x;
      if (keys[at] == 0 || !may_win(&p, x, y, keys[at], rank_dilation)) continue;
      const Sample q = sample_primitive(&p, x, y, dilation);
      if (q.distance < 0.0f || make_key(q.distance, rank_dilation, q.w) != keys[at]) continue;
      __global const uint* corner = indices + 3 * (size_t)order[j];
      const float3 k = barycentric(&p.triangle, (float2)((float)x, (float)y));
      raise(texel_normals + at,
            pack_normal(load3(normals, corner[0]) * k.x + load3(normals, corner[1]) * k.y +
                        load3(normals, corner[2]) * k.z));
      if (has_colors)
        raise(texel_colors + at, 0x10000u | pack_color(unpack_color(colors[corner[0]]) * k.x +
                                                       unpack_color(colors[corner[1]]) * k.y +
                                                       unpack_color(colors[corner[2]]) * k.z));
    }
  }
}
