// What a level's streams are made of: zstd frames, columns of bytes, differences, meshoptimizer's vertex
// codec (docs/file_format.md, "Streams").
#pragma once

#include <meshoptimizer.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rbvh {

using ByteVector = std::vector<std::uint8_t>;

ByteVector compress(const ByteVector& raw);

/// False where the stream is not whole, or would have more than `most` bytes.
bool decompress(const ByteVector& packed, std::size_t most, ByteVector& raw);

/// Values as columns of bytes, the lowest of all values first: like bytes lie together and compress well.
class Columns {
 public:
  /// `bytes`: of each value.
  template <class T>
  void add(const std::vector<T>& values, std::size_t bytes = sizeof(T)) {
    for (std::size_t byte = 0; byte < bytes; ++byte)
      for (const T value : values)
        raw.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * byte)));
  }
  ByteVector raw;
};

class ColumnReader {
 public:
  explicit ColumnReader(const ByteVector& raw) : raw_(raw) {}

  template <class T>
  std::vector<T> take(std::size_t count) {
    std::vector<T> values(count);
    for (std::size_t byte = 0; byte < sizeof(T); ++byte)
      for (T& value : values)
        value = static_cast<T>(value | static_cast<T>(static_cast<T>(raw_.at(at_++)) << (8 * byte)));
    return values;
  }

 private:
  const ByteVector& raw_;
  std::size_t at_ = 0;
};

/// Differences to the value before, small ones of either sign as small numbers.
inline std::uint32_t zigzag(std::int32_t value, std::int32_t before) {
  const auto difference = static_cast<std::uint32_t>(value) - static_cast<std::uint32_t>(before);
  return (difference << 1) ^ (0u - (difference >> 31));
}
inline std::int32_t unzigzag(std::uint32_t code, std::int32_t before) {
  const std::uint32_t difference = (code >> 1) ^ (0u - (code & 1));
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(before) + difference);
}

/// The count behind the values in four bytes: the codec alone pads to groups of 16 and would take a wrong
/// one.
template <class T>
ByteVector encode_vertices(const std::vector<T>& values) {
  static_assert(sizeof(T) % 4 == 0);
  ByteVector raw(meshopt_encodeVertexBufferBound(values.size(), sizeof(T)));
  raw.resize(meshopt_encodeVertexBuffer(raw.data(), raw.size(), values.data(), values.size(), sizeof(T)));
  for (int byte = 0; byte < 4; ++byte) raw.push_back(static_cast<std::uint8_t>(values.size() >> (8 * byte)));
  return compress(raw);
}

template <class T>
bool decode_vertices(const ByteVector& packed, std::size_t count, std::vector<T>& values) {
  ByteVector raw;
  if (!decompress(packed, meshopt_encodeVertexBufferBound(count, sizeof(T)) + 4, raw) || raw.size() < 4)
    return false;
  for (int byte = 3; byte >= 0; --byte) {
    if (raw.back() != static_cast<std::uint8_t>(count >> (8 * byte))) return false;
    raw.pop_back();
  }
  values.resize(count);
  return meshopt_decodeVertexBuffer(values.data(), count, sizeof(T), raw.data(), raw.size()) == 0;
}

}  // namespace rbvh
