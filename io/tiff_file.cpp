#include "io/tiff_file.h"

#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>

#include "io/max_expansion.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr std::uint32_t kLargestTile = 4096;
constexpr std::size_t kTileGrain = 8;  // decoded by one thread

}  // namespace

struct TiffFile::Handle {
  std::span<const std::byte> file;
  std::uint64_t at = 0;
  std::string fault;
  TIFF* tiff = nullptr;

  explicit Handle(std::span<const std::byte> bytes);
  ~Handle() {
    if (tiff != nullptr) TIFFClose(tiff);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  template <class T>
  T get(std::uint32_t tag) const {
    T value{};
    TIFFGetFieldDefaulted(tiff, tag, &value);
    return value;
  }
  TiffImage describe() const;
  void decode_tile(const TiffImage& image, std::uint32_t tile, std::vector<std::uint16_t>& buffer,
                   std::uint16_t* texels);
};

TiffFile::Handle::Handle(std::span<const std::byte> bytes) : file(bytes) {
  const auto keep_fault = [](TIFF*, void* handle, const char*, const char* format, va_list values) {
    char text[256];
    std::vsnprintf(text, sizeof text, format, values);
    static_cast<Handle*>(handle)->fault = text;
    return 1;
  };
  const auto ignore = [](TIFF*, void*, const char*, const char*, va_list) { return 1; };
  const auto read = [](thandle_t handle, void* to, tmsize_t wanted) {
    auto& self = *static_cast<Handle*>(handle);
    const std::uint64_t left = self.file.size() - std::min<std::uint64_t>(self.at, self.file.size());
    const auto count = std::min(static_cast<std::uint64_t>(wanted), left);
    if (count > 0) std::memcpy(to, self.file.data() + self.at, count);
    self.at += count;
    return static_cast<tmsize_t>(count);
  };
  const auto write = [](thandle_t, void*, tmsize_t) { return tmsize_t{-1}; };
  const auto seek = [](thandle_t handle, toff_t offset, int whence) {
    auto& self = *static_cast<Handle*>(handle);
    const toff_t from = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? self.at : self.file.size();
    return toff_t{self.at = from + offset};
  };
  const auto size = [](thandle_t handle) { return toff_t{static_cast<Handle*>(handle)->file.size()}; };
  const auto map = [](thandle_t handle, void** base, toff_t* length) {
    const auto& self = *static_cast<Handle*>(handle);
    *base = const_cast<std::byte*>(self.file.data());  // libtiff only reads there
    *length = self.file.size();
    return 1;
  };
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                 TIFFOpenOptionsFree);
  if (options == nullptr) throw std::bad_alloc();
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), static_cast<tmsize_t>(kMaxExpansion * file.size()));
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_fault, this);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore, nullptr);
  tiff = TIFFClientOpenExt(
      "atlas.tif", "r", this, read, write, seek, [](thandle_t) { return 0; }, size, map,
      [](thandle_t, void*, toff_t) {}, options.get());
  if (tiff == nullptr) throw TiffFault(fault);
}

TiffImage TiffFile::Handle::describe() const {
  TiffImage image;
  image.width = get<std::uint32_t>(TIFFTAG_IMAGEWIDTH);
  image.height = get<std::uint32_t>(TIFFTAG_IMAGELENGTH);
  if (const char* text = get<const char*>(TIFFTAG_IMAGEDESCRIPTION)) image.description = text;
  const bool is_tiled = TIFFIsTiled(tiff) != 0;
  image.tile_width = is_tiled ? get<std::uint32_t>(TIFFTAG_TILEWIDTH) : image.width;
  image.tile_height = is_tiled ? get<std::uint32_t>(TIFFTAG_TILELENGTH)
                               : std::min(get<std::uint32_t>(TIFFTAG_ROWSPERSTRIP), image.height);
  const std::uint16_t channels = get<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL);
  const tmsize_t tile_bytes = is_tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff);
  const std::uint16_t compression = get<std::uint16_t>(TIFFTAG_COMPRESSION);
  const bool is_usable =
      (compression == COMPRESSION_NONE || compression == COMPRESSION_LZW ||
       compression == COMPRESSION_PACKBITS || compression == COMPRESSION_ADOBE_DEFLATE ||
       compression == COMPRESSION_DEFLATE) &&
      static_cast<std::uint64_t>(tile_bytes) <= kMaxExpansion * file.size() &&
      get<std::uint16_t>(TIFFTAG_BITSPERSAMPLE) == 16 &&
      get<std::uint16_t>(TIFFTAG_SAMPLEFORMAT) == SAMPLEFORMAT_UINT &&
      get<std::uint16_t>(TIFFTAG_PLANARCONFIG) == PLANARCONFIG_CONTIG &&
      get<std::uint32_t>(TIFFTAG_IMAGEDEPTH) == 1 && image.tile_width > 0 && image.tile_height > 0 &&
      (!is_tiled || std::max(image.tile_width, image.tile_height) <= kLargestTile) &&
      static_cast<std::uint64_t>(tile_bytes) ==
          std::uint64_t{image.tile_width} * image.tile_height * channels * sizeof(std::uint16_t);
  if (is_usable) image.channels = channels;
  const std::uint64_t* bytes =
      get<const std::uint64_t*>(is_tiled ? TIFFTAG_TILEBYTECOUNTS : TIFFTAG_STRIPBYTECOUNTS);
  if (is_usable && bytes != nullptr)
    for (std::uint32_t i = 0; i < (is_tiled ? TIFFNumberOfTiles(tiff) : TIFFNumberOfStrips(tiff)); ++i)
      image.stored_bytes =
          std::min<std::uint64_t>(image.stored_bytes + std::min(bytes[i], file.size()), file.size());
  return image;
}

void TiffFile::Handle::decode_tile(const TiffImage& image, std::uint32_t tile,
                                   std::vector<std::uint16_t>& buffer, std::uint16_t* texels) {
  const std::uint32_t in_row = (image.width + image.tile_width - 1) / image.tile_width;
  const std::uint32_t x = tile % in_row * image.tile_width, y = tile / in_row * image.tile_height;
  const std::uint32_t rows = std::min(image.tile_height, image.height - y);
  const std::size_t row_values = std::size_t{image.tile_width} * image.channels;
  buffer.resize(row_values * image.tile_height);
  const bool is_tiled = TIFFIsTiled(tiff) != 0;
  const auto wanted =
      static_cast<tmsize_t>(row_values * (is_tiled ? image.tile_height : rows) * sizeof(std::uint16_t));
  const tmsize_t got = is_tiled ? TIFFReadEncodedTile(tiff, tile, buffer.data(), wanted)
                                : TIFFReadEncodedStrip(tiff, tile, buffer.data(), wanted);
  if (got != wanted) throw TiffFault(fault.empty() ? "it is cut" : fault);
  const std::size_t columns = std::min(image.tile_width, image.width - x);
  for (std::size_t row = 0; row < rows; ++row)
    std::copy_n(buffer.data() + row * row_values, columns * image.channels,
                texels + ((y + row) * image.width + x) * image.channels);
}

TiffFile::TiffFile(std::span<const std::byte> file) : file_(file), handle_(std::make_shared<Handle>(file)) {
  image_ = handle_->describe();
}

bool TiffFile::next() {
  if (TIFFReadDirectory(handle_->tiff) == 0) return false;
  image_ = handle_->describe();
  return true;
}

std::vector<std::uint16_t> TiffFile::decode() const {
  std::vector<std::uint16_t> texels(std::size_t{image_.width} * image_.height * image_.channels);
  const auto pieces = [](std::uint32_t size, std::uint32_t piece) { return (size + piece - 1) / piece; };
  const std::size_t tiles =
      std::size_t{pieces(image_.width, image_.tile_width)} * pieces(image_.height, image_.tile_height);
  const toff_t directory = TIFFCurrentDirOffset(handle_->tiff);
  parallel_for(tiles, kTileGrain, [&](std::size_t begin, std::size_t end) {
    Handle handle(file_);  // libtiff decodes one tile of a file at a time
    if (TIFFSetSubDirectory(handle.tiff, directory) == 0) throw TiffFault(handle.fault);
    std::vector<std::uint16_t> buffer;
    for (std::size_t tile = begin; tile < end; ++tile)
      handle.decode_tile(image_, static_cast<std::uint32_t>(tile), buffer, texels.data());
  });
  return texels;
}

}  // namespace rbvh
