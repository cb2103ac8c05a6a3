#include "io/stream_codec.h"

#include <zstd.h>

#include <new>

namespace rbvh {
namespace {

// Measured on the dragon's five levels: level 9 gives 1% more than 19 in a tenth of the time.
constexpr int kZstdLevel = 9;

}  // namespace

ByteVector compress(const ByteVector& raw) {
  ByteVector packed(ZSTD_compressBound(raw.size()));
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), raw.data(), raw.size(), kZstdLevel);
  if (ZSTD_isError(size) != 0) throw std::bad_alloc();
  packed.resize(size);
  return packed;
}

bool decompress(const ByteVector& packed, std::size_t most, ByteVector& raw) {
  const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN || size > most) return false;
  raw.resize(static_cast<std::size_t>(size));
  return ZSTD_decompress(raw.data(), raw.size(), packed.data(), packed.size()) == size;
}

}  // namespace rbvh
