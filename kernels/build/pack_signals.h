// A texel's normal and colour, 16 bits each, as the file has them.
#ifndef RBVH_PACK_SIGNALS_H
#define RBVH_PACK_SIGNALS_H

// Octahedral, 8 bits a coordinate.
static inline uint pack_normal(float4 n) {
  const float sum = fabs(n.x) + fabs(n.y) + fabs(n.z);
  if (!(sum > 0.0f)) return 0x8080u;
  float2 p = n.xy / sum;
  if (n.z < 0.0f) p = (1.0f - fabs(p.yx)) * (float2)(n.x < 0.0f ? -1.0f : 1.0f, n.y < 0.0f ? -1.0f : 1.0f);
  const float2 q = clamp(floor(p * 127.0f + 128.5f), 1.0f, 255.0f);
  return (uint)q.x | ((uint)q.y << 8);
}

// 5-6-5, of bytes.
static inline uint pack_color(float4 c) {
  const float4 q = clamp(floor(c * (float4)(31.0f, 63.0f, 31.0f, 0.0f) / 255.0f + 0.5f), 0.0f, 63.0f);
  return ((uint)q.x << 11) | ((uint)q.y << 5) | (uint)q.z;
}

// Of 0xBBGGRR.
static inline float4 unpack_color(uint c) {
  return (float4)((float)(c & 255u), (float)((c >> 8) & 255u), (float)((c >> 16) & 255u), 0.0f);
}

#endif
