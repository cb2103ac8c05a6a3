// Owen-scrambled Sobol points (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020): four dimensions at
// a time, those of the next four shuffled against these.
#pragma once

#include <array>
#include <cstdint>

namespace rbvh {

inline std::uint32_t hash32(std::uint32_t x) {  // lowbias32, Wellons
  x = (x ^ (x >> 16)) * 0x7feb352du;
  x = (x ^ (x >> 15)) * 0x846ca68bu;
  return x ^ (x >> 16);
}

inline std::uint32_t hash32(std::uint32_t a, std::uint32_t b) { return hash32(a ^ hash32(b + 0x9e3779b9u)); }

inline std::uint32_t reverse_bits(std::uint32_t x) {
  x = (x << 16) | (x >> 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

/// Owen's nested uniform scrambling of a number's bits, from the highest on.
inline std::uint32_t owen_scramble(std::uint32_t x, std::uint32_t seed) {
  x = reverse_bits(x);
  x += seed;  // the Laine-Karras permutation, with Burley's constants
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return reverse_bits(x);
}

namespace sobol_detail {

// Direction numbers by Joe and Kuo: the primitive polynomial's degree and inner coefficients, the first m.
constexpr std::array<std::uint32_t, 32> directions(unsigned degree, unsigned coefficients,
                                                   std::array<std::uint32_t, 3> m) {
  std::array<std::uint32_t, 32> v{};
  for (unsigned i = 0; i < 32; ++i) {
    if (i < degree) {
      v[i] = m[i] << (31 - i);
      continue;
    }
    v[i] = v[i - degree] ^ (v[i - degree] >> degree);
    for (unsigned k = 1; k < degree; ++k)
      if ((coefficients >> (degree - 1 - k)) & 1) v[i] ^= v[i - k];
  }
  return v;
}

using ByteTable = std::array<std::array<std::uint32_t, 256>, 4>;

/// What each byte of an index adds to a coordinate: four look-ups in place of 32 steps.
constexpr ByteTable byte_table(const std::array<std::uint32_t, 32>& directions) {
  ByteTable table{};
  for (unsigned byte = 0; byte < 4; ++byte)
    for (unsigned value = 0; value < 256; ++value)
      for (unsigned bit = 0; bit < 8; ++bit)
        if ((value >> bit) & 1) table[byte][value] ^= directions[8 * byte + bit];
  return table;
}

inline constexpr ByteTable kTables[3] = {byte_table(directions(1, 0, {1, 0, 0})),
                                         byte_table(directions(2, 1, {1, 3, 0})),
                                         byte_table(directions(3, 1, {1, 3, 1}))};

inline std::uint32_t coordinate(std::uint32_t index, int dimension) {
  if (dimension == 0) return reverse_bits(index);
  const ByteTable& table = kTables[dimension - 1];
  return table[0][index & 255] ^ table[1][(index >> 8) & 255] ^ table[2][(index >> 16) & 255] ^
         table[3][index >> 24];
}

}  // namespace sobol_detail

/// In [0, 1).
inline float unit_float(std::uint32_t x) { return static_cast<float>(x >> 8) * 0x1p-24f; }

/// The four coordinates of a point, in [0, 1). `group` counts the dimensions in fours; other seeds give
/// other, independent sequences.
inline std::array<float, 4> sobol_point(std::uint32_t index, std::uint32_t seed, std::uint32_t group) {
  const std::uint32_t own = hash32(seed, group);
  const std::uint32_t shuffled = owen_scramble(index, own);
  std::array<float, 4> point{};
  for (int d = 0; d < 4; ++d)
    point[static_cast<std::size_t>(d)] = unit_float(
        owen_scramble(sobol_detail::coordinate(shuffled, d), hash32(own, static_cast<std::uint32_t>(d) + 1)));
  return point;
}

}  // namespace rbvh
