#include "io/tiff_writer.h"

#include <fcntl.h>
#include <libdeflate.h>
#include <tiffio.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <vector>

#include "io/posix_file.h"
#include "io/tiff_file.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

static_assert(std::endian::native == std::endian::little, "texels are written as they lie in memory");

// Of a scanned cloud's Q0 (356 k texels of height and normal) libdeflate's level 6 makes 606 kB in 0.14 s,
// level 8 600 kB in 0.28 s, level 10 574 kB in 0.75 s; zlib's level 6 made 603 kB in 0.27 s. TIFF tiles take
// half the time of strips; those of 256 are 1% smaller than those of 128.
constexpr int kZipLevel = 8;
constexpr std::uint32_t kLargestTile = 256;
constexpr std::size_t kTilesAtOnce = 64;  // compressed, then written
constexpr std::uint64_t kMostOfClassicTiff = 3'900'000'000;

std::uint32_t tile_side(std::uint32_t size) {
  return std::min(kLargestTile, (size + 15) / 16 * 16);  // TIFF: times 16
}

/// A tile's texels, zeros beyond the image, each less the one before it in its row.
std::vector<std::uint16_t> differences(const TiffTexels& image, std::uint32_t x, std::uint32_t y,
                                       std::uint32_t tile_width, std::uint32_t tile_height) {
  const std::size_t channels = image.channels, row_values = tile_width * channels;
  const std::size_t columns = std::min(tile_width, image.width - x),
                    rows = std::min(tile_height, image.height - y);
  std::vector<std::uint16_t> tile(row_values * tile_height);
  for (std::size_t r = 0; r < rows; ++r) {
    std::uint16_t* const row = &tile[r * row_values];
    std::copy_n(&image.texels[((y + r) * image.width + x) * channels], columns * channels, row);
    for (std::size_t i = row_values; i-- > channels;)
      row[i] = static_cast<std::uint16_t>(row[i] - row[i - channels]);
  }
  return tile;
}

}  // namespace

struct TiffWriter::Handle {
  Descriptor file;
  std::string fault;
  TIFF* tiff = nullptr;

  explicit Handle(int fd) : file{fd} {}
  ~Handle() {
    if (tiff != nullptr) TIFFClose(tiff);
  }
  [[noreturn]] void fail() const { throw TiffFault(fault.empty() ? std::strerror(errno) : fault); }
  void check(bool done) const {
    if (!done || !fault.empty()) fail();
  }
};

TiffWriter::TiffWriter(const std::string& path, std::uint64_t texel_bytes)
    : handle_(std::make_unique<Handle>(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666))) {
  if (handle_->file.fd < 0) handle_->fail();
  const auto keep_fault = [](TIFF*, void* handle, const char*, const char* format, va_list values) {
    auto& fault = static_cast<Handle*>(handle)->fault;
    char text[256];
    std::vsnprintf(text, sizeof text, format, values);
    if (fault.empty()) fault = text;
    return 1;
  };
  const auto ignore = [](TIFF*, void*, const char*, const char*, va_list) { return 1; };
  const auto read = [](thandle_t handle, void* to, tmsize_t count) {
    return static_cast<tmsize_t>(
        ::read(static_cast<Handle*>(handle)->file.fd, to, static_cast<std::size_t>(count)));
  };
  // The reason of the first failure: libtiff only knows that there was one.
  const auto write = [](thandle_t handle, void* from, tmsize_t count) {
    auto& self = *static_cast<Handle*>(handle);
    tmsize_t done = 0;
    while (done < count) {
      const ssize_t now =
          ::write(self.file.fd, static_cast<char*>(from) + done, static_cast<std::size_t>(count - done));
      if (now < 0 && errno == EINTR) continue;
      if (now <= 0) {
        if (self.fault.empty()) self.fault = std::strerror(now < 0 ? errno : ENOSPC);
        break;
      }
      done += now;
    }
    return done;
  };
  const auto seek = [](thandle_t handle, toff_t offset, int whence) {
    return static_cast<toff_t>(
        ::lseek(static_cast<Handle*>(handle)->file.fd, static_cast<off_t>(offset), whence));
  };
  const auto size = [](thandle_t handle) {
    return static_cast<toff_t>(
        std::max<off_t>(0, ::lseek(static_cast<Handle*>(handle)->file.fd, 0, SEEK_END)));
  };
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                 TIFFOpenOptionsFree);
  if (options == nullptr) throw std::bad_alloc();
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_fault, handle_.get());
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore, nullptr);
  handle_->tiff = TIFFClientOpenExt(
      "atlas.tif", texel_bytes > kMostOfClassicTiff ? "wl8" : "wl", handle_.get(), read, write, seek,
      [](thandle_t) { return 0; }, size, [](thandle_t, void**, toff_t*) { return 0; },
      [](thandle_t, void*, toff_t) {}, options.get());
  handle_->check(handle_->tiff != nullptr);
}

TiffWriter::~TiffWriter() = default;

void TiffWriter::add(const TiffTexels& image) {
  TIFF* const tiff = handle_->tiff;
  const std::uint32_t width = tile_side(image.width), height = tile_side(image.height);
  const bool is_rgb = image.channels == 3;
  const std::vector<std::uint16_t> further(image.channels - 1, EXTRASAMPLE_UNSPECIFIED);
  // The time and the library's version are left out: identical work gives identical bytes.
  handle_->check(TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, image.width) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, image.height) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 16) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, image.channels) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, is_rgb ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK) !=
                     0 &&
                 TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_TILEWIDTH, width) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_TILELENGTH, height) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, image.description.c_str()) != 0 &&
                 TIFFSetField(tiff, TIFFTAG_SOFTWARE, "rbvh") != 0);
  if (!is_rgb && !further.empty())
    handle_->check(
        TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, static_cast<int>(further.size()), further.data()) != 0);

  const std::size_t in_row = (image.width + width - 1) / width,
                    tiles = in_row * ((image.height + height - 1) / height);
  std::vector<std::vector<std::byte>> packed(std::min(tiles, kTilesAtOnce));
  for (std::size_t first = 0; first < tiles; first += kTilesAtOnce) {
    const std::size_t count = std::min(kTilesAtOnce, tiles - first);
    parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
      const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
          libdeflate_alloc_compressor(kZipLevel), libdeflate_free_compressor);
      if (compressor == nullptr) throw std::bad_alloc();
      for (std::size_t i = begin; i < end; ++i) {
        const auto x = static_cast<std::uint32_t>((first + i) % in_row * width),
                   y = static_cast<std::uint32_t>((first + i) / in_row * height);
        const auto raw = differences(image, x, y, width, height);
        const std::size_t raw_bytes = raw.size() * sizeof raw[0];
        packed[i].resize(libdeflate_zlib_compress_bound(compressor.get(), raw_bytes));
        packed[i].resize(libdeflate_zlib_compress(compressor.get(), raw.data(), raw_bytes, packed[i].data(),
                                                  packed[i].size()));
      }
    });
    for (std::size_t i = 0; i < count; ++i)
      handle_->check(TIFFWriteRawTile(tiff, static_cast<std::uint32_t>(first + i), packed[i].data(),
                                      static_cast<tmsize_t>(packed[i].size())) >= 0);
  }
  handle_->check(TIFFWriteDirectory(tiff) != 0);
}

std::uint64_t TiffWriter::bytes() const {
  return static_cast<std::uint64_t>(std::max<off_t>(0, ::lseek(handle_->file.fd, 0, SEEK_END)));
}

void TiffWriter::close() {
  TIFFClose(handle_->tiff);
  handle_->tiff = nullptr;
  handle_->check(handle_->file.close() == 0);
}

}  // namespace rbvh
