// Vector operations that OpenCL C lacks: a comparison's lanes as bits (lane 0 lowest), a gather, the least
// and the greatest lane. Where the compiler is clang for AVX-512 (PoCL), its built-ins are one instruction
// each.
#ifndef RBVH_LANES_H
#define RBVH_LANES_H

// PoCL's compiler passes vectors of 16 through memory where it does not inline.
#ifdef NO_FORCED_INLINING  // Oclgrind does not know what clang leaves of inlined functions that return
                           // structs
#define ALWAYS_INLINE inline
#else
#define ALWAYS_INLINE inline __attribute__((always_inline))
#endif

// A scalar comparison is one lane.
static inline uint lane_bits1(int lane) { return lane != 0 ? 1u : 0u; }

static inline uint lane_bits4(int4 lanes) {
#if defined(__clang__) && defined(__SSE__)
  return (uint)__builtin_ia32_movmskps(as_float4(lanes));
#else
  const int4 bits = lanes & (int4)(1, 2, 4, 8);
  return (uint)(bits.x | bits.y | bits.z | bits.w);
#endif
}

#if defined(__clang__) && defined(__AVX512DQ__) && defined(__AVX512VL__)
static inline uint lane_bits8(int8 lanes) { return (uchar)__builtin_ia32_cvtd2mask256(lanes); }
static inline uint lane_bits16(int16 lanes) { return (ushort)__builtin_ia32_cvtd2mask512(lanes); }
// Reads two numbers a lane, so the buffer is one longer than it needs to be.
static inline int16 gather16(__global const ushort* from, int16 at) {
  return __builtin_ia32_gathersiv16si((int16)(0), (const void*)(size_t)from, at, (ushort)0xffff, 2) & 0xffff;
}
static inline float16 gather_floats16(__global const float* from, int16 at) {
  return __builtin_ia32_gathersiv16sf((float16)(0), (const void*)(size_t)from, at, (ushort)0xffff, 4);
}
// Lane i is lane at[i] of `from`, for at[i] from 0 to 15.
static inline float16 permute16(float16 from, int16 at) { return __builtin_ia32_permvarsf512(from, at); }
#else
static inline float16 permute16(float16 from, int16 at) {
  float f[16];
  vstore16(from, 0, f);
  return (float16)(f[at.s0], f[at.s1], f[at.s2], f[at.s3], f[at.s4], f[at.s5], f[at.s6], f[at.s7], f[at.s8],
                   f[at.s9], f[at.sa], f[at.sb], f[at.sc], f[at.sd], f[at.se], f[at.sf]);
}
static inline float16 gather_floats16(__global const float* from, int16 at) {
  return (float16)(from[at.s0], from[at.s1], from[at.s2], from[at.s3], from[at.s4], from[at.s5], from[at.s6],
                   from[at.s7], from[at.s8], from[at.s9], from[at.sa], from[at.sb], from[at.sc], from[at.sd],
                   from[at.se], from[at.sf]);
}
static inline uint lane_bits8(int8 lanes) {
  const int8 bits = lanes & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
  const int4 b4 = bits.lo | bits.hi;
  const int2 b2 = b4.lo | b4.hi;
  return (uint)(b2.x | b2.y);
}
static inline uint lane_bits16(int16 lanes) { return lane_bits8(lanes.lo) | lane_bits8(lanes.hi) << 8; }
static inline int16 gather16(__global const ushort* from, int16 at) {
  return (int16)(from[at.s0], from[at.s1], from[at.s2], from[at.s3], from[at.s4], from[at.s5], from[at.s6],
                 from[at.s7], from[at.s8], from[at.s9], from[at.sa], from[at.sb], from[at.sc], from[at.sd],
                 from[at.se], from[at.sf]);
}
#endif

// The lanes that are bits of a number.
static ALWAYS_INLINE int16 lanes_of_bits16(uint bits) {
  const int16 bit = (int16)(0x1, 0x2, 0x4, 0x8, 0x10, 0x20, 0x40, 0x80, 0x100, 0x200, 0x400, 0x800, 0x1000,
                            0x2000, 0x4000, 0x8000);
  return (bit & (int)bits) != 0;
}

// Asks for memory that will be read soon.
#if defined(__clang__) && defined(__AVX512VL__)
#define ASK(from, bytes) \
  for (uint line = 0; line < (bytes); line += 64) __builtin_prefetch((const char*)(size_t)(from) + line)
#else
#define ASK(from, bytes) (void)0
#endif

// Pairs of two rows' elements, and of their pairs: within 128 bits, as wide vector units shuffle fastest.
#define UNPACK_LO(a, b) \
  (float16)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5, a.s8, b.s8, a.s9, b.s9, a.sc, b.sc, a.sd, b.sd)
#define UNPACK_HI(a, b) \
  (float16)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7, a.sa, b.sa, a.sb, b.sb, a.se, b.se, a.sf, b.sf)
#define PAIRS_LO(a, b) (float16)(a.s01, b.s01, a.s45, b.s45, a.s89, b.s89, a.scd, b.scd)
#define PAIRS_HI(a, b) (float16)(a.s23, b.s23, a.s67, b.s67, a.sab, b.sab, a.sef, b.sef)

// Four rows of sixteen lanes: the quad of lane 4 i + k is quads[k]'s i-th, and the other way round.
static ALWAYS_INLINE void transpose4(const float16* rows, float16* quads) {
  const float16 lo01 = UNPACK_LO(rows[0], rows[1]), hi01 = UNPACK_HI(rows[0], rows[1]);
  const float16 lo23 = UNPACK_LO(rows[2], rows[3]), hi23 = UNPACK_HI(rows[2], rows[3]);
  quads[0] = PAIRS_LO(lo01, lo23);
  quads[1] = PAIRS_HI(lo01, lo23);
  quads[2] = PAIRS_LO(hi01, hi23);
  quads[3] = PAIRS_HI(hi01, hi23);
}

// Four rows of 16 lanes as 16 groups of four floats, lane after lane, `stride` floats from one to the next.
static ALWAYS_INLINE void store_transposed4(const float16* rows, uint stride, float* to) {
  float16 quads[4];
  transpose4(rows, quads);
  for (uint k = 0; k < 4; ++k) {
    vstore4(quads[k].s0123, 0, to + stride * k);
    vstore4(quads[k].s4567, 0, to + stride * (k + 4));
    vstore4(quads[k].s89ab, 0, to + stride * (k + 8));
    vstore4(quads[k].scdef, 0, to + stride * (k + 12));
  }
}

static inline float greatest(float16 v) {
  const float8 v8 = max(v.lo, v.hi);
  const float4 v4 = max(v8.lo, v8.hi);
  const float2 v2 = max(v4.lo, v4.hi);
  return max(v2.x, v2.y);
}

static inline float least(float16 v) {
  const float8 v8 = min(v.lo, v.hi);
  const float4 v4 = min(v8.lo, v8.hi);
  const float2 v2 = min(v4.lo, v4.hi);
  return min(v2.x, v2.y);
}

#ifdef __BMI__
static inline uint lowest_bit(uint mask) { return (uint)__builtin_ctz(mask); }
#else
static inline uint lowest_bit(uint mask) { return 31u - clz(mask & (0u - mask)); }
#endif
#endif
