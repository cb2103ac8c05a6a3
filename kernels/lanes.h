// A comparison's lanes as bits, lane 0 lowest. OpenCL C has no word for it; where the compiler is clang for
// AVX-512 (PoCL), its own word is one instruction.
#ifndef RBVH_LANES_H
#define RBVH_LANES_H

#if defined(__clang__) && defined(__AVX512DQ__) && defined(__AVX512VL__)
static inline uint lane_bits8(int8 lanes) { return (uchar)__builtin_ia32_cvtd2mask256(lanes); }
static inline uint lane_bits16(int16 lanes) { return (ushort)__builtin_ia32_cvtd2mask512(lanes); }
#else
static inline uint lane_bits8(int8 lanes) {
  const int8 bits = lanes & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
  const int4 b4 = bits.lo | bits.hi;
  const int2 b2 = b4.lo | b4.hi;
  return (uint)(b2.x | b2.y);
}
static inline uint lane_bits16(int16 lanes) { return lane_bits8(lanes.lo) | lane_bits8(lanes.hi) << 8; }
#endif

static inline uint lowest_bit(uint mask) { return 31u - clz(mask & (0u - mask)); }
#endif
