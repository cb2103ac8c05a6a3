#include "io/png.h"

#include <libdeflate.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <string_view>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

// Of a preview of 1024 x 1024, with the filters 420 kB: level 4 takes 20 ms and 1.5% more bytes, level 6 85
// ms and 2% less.
constexpr int kLevel = 5;
constexpr std::size_t kRows = 64;  // filtered by one thread

using Bytes = std::vector<std::byte>;

/// Big-endian.
void put_number(Bytes& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::byte>(value >> shift));
}

void put_chunk(Bytes& out, std::string_view name, std::span<const std::byte> data) {
  put_number(out, static_cast<std::uint32_t>(data.size()));
  const std::size_t from = out.size();
  const auto* letters = reinterpret_cast<const std::byte*>(name.data());
  out.insert(out.end(), letters, letters + name.size());
  out.insert(out.end(), data.begin(), data.end());
  put_number(out, libdeflate_crc32(0, out.data() + from, out.size() - from));
}

std::uint8_t average(int left, int up, int) { return static_cast<std::uint8_t>((left + up) / 2); }

std::uint8_t paeth(int left, int up, int up_left) {
  const int by_left = std::abs(up - up_left), by_up = std::abs(left - up_left),
            by_both = std::abs(left + up - 2 * up_left);
  const int closer = by_up <= by_both ? up : up_left;
  return static_cast<std::uint8_t>(by_left <= by_up && by_left <= by_both ? left : closer);
}

/// A row less what `predict` makes of its neighbours; returns how far from zero that is.
template <class Predict>
std::uint64_t filter(std::span<const std::uint8_t> row, const std::uint8_t* above, std::size_t channels,
                     Predict predict, std::uint8_t* out) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < channels; ++i) {
    out[i] = static_cast<std::uint8_t>(row[i] - predict(0, above[i], 0));
    sum += static_cast<std::uint32_t>(std::abs(static_cast<std::int8_t>(out[i])));
  }
  for (std::size_t i = channels; i < row.size(); ++i) {
    out[i] = static_cast<std::uint8_t>(row[i] - predict(row[i - channels], above[i], above[i - channels]));
    sum += static_cast<std::uint32_t>(std::abs(static_cast<std::int8_t>(out[i])));
  }
  return sum;
}

/// Each row with the number of its filter before it: of the five, the one that leaves the least.
std::vector<std::uint8_t> filter_rows(std::size_t row_bytes, std::size_t rows, std::size_t channels,
                                      std::span<const std::uint8_t> pixels) {
  std::vector<std::uint8_t> filtered(rows * (row_bytes + 1));
  parallel_for(rows, kRows, [&](std::size_t begin, std::size_t end) {
    const std::vector<std::uint8_t> nothing(row_bytes);
    std::vector<std::uint8_t> tried(row_bytes);
    for (std::size_t y = begin; y < end; ++y) {
      const auto row = pixels.subspan(y * row_bytes, row_bytes);
      const std::uint8_t* const above = y > 0 ? row.data() - row_bytes : nothing.data();
      std::uint8_t* const out = filtered.data() + y * (row_bytes + 1);
      std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
      const auto attempt = [&](std::uint8_t number, auto predict) {
        const std::uint64_t sum = filter(row, above, channels, predict, tried.data());
        if (sum >= least) return;
        least = sum;
        out[0] = number;
        std::copy(tried.begin(), tried.end(), out + 1);
      };
      attempt(0, [](int, int, int) { return std::uint8_t{0}; });
      if (least == 0) continue;
      attempt(1, [](int left, int, int) { return static_cast<std::uint8_t>(left); });
      attempt(2, [](int, int up, int) { return static_cast<std::uint8_t>(up); });
      attempt(3, average);
      attempt(4, paeth);
    }
  });
  return filtered;
}

}  // namespace

std::vector<std::byte> encode_png(std::uint32_t width, std::uint32_t height, std::size_t channels,
                                  std::span<const std::uint8_t> pixels, bool is_srgb) {
  RBVH_CHECK(channels >= 1 && channels <= 4 && pixels.size() == std::size_t{width} * height * channels);
  const std::vector<std::uint8_t> filtered = filter_rows(width * channels, height, channels, pixels);
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
      libdeflate_alloc_compressor(kLevel), libdeflate_free_compressor);
  if (compressor == nullptr) throw std::bad_alloc();
  Bytes data(libdeflate_zlib_compress_bound(compressor.get(), filtered.size()));
  data.resize(
      libdeflate_zlib_compress(compressor.get(), filtered.data(), filtered.size(), data.data(), data.size()));

  constexpr std::uint8_t kColorTypes[] = {0, 4, 2, 6};
  Bytes out, header;
  for (const char c : std::string_view("\x89PNG\r\n\x1a\n")) out.push_back(static_cast<std::byte>(c));
  put_number(header, width);
  put_number(header, height);
  for (const std::uint8_t value :
       {std::uint8_t{8}, kColorTypes[channels - 1], std::uint8_t{0}, std::uint8_t{0},
        std::uint8_t{0}})  // bits, colours, deflate, the five filters, not interlaced
    header.push_back(std::byte{value});
  put_chunk(out, "IHDR", header);
  if (is_srgb) put_chunk(out, "sRGB", Bytes{std::byte{0}});
  // A chunk holds less than 2 GB.
  constexpr std::size_t kMost = std::size_t{1} << 30;
  for (std::size_t at = 0; at < data.size(); at += kMost)
    put_chunk(out, "IDAT", std::span(data).subspan(at, std::min(kMost, data.size() - at)));
  put_chunk(out, "IEND", {});
  return out;
}

}  // namespace rbvh
