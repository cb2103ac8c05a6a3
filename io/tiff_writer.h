// TIFF files of 16-bit texels, written by libtiff. OpenImageIO, which writes such files by it, too, takes
// longer to load than a small pair takes to build.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace rbvh {

/// A subimage of interleaved texels.
struct TiffTexels {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::string description;
  std::span<const std::uint16_t> texels;
};

/// One subimage after the other, in tiles of zlib streams with the horizontal predictor, compressed by all
/// host threads. Equal texels give equal bytes. Functions throw TiffFault (tiff_file.h) with what is wrong;
/// only after close() is the file whole.
class TiffWriter {
 public:
  /// Empties the file. `texel_bytes`: of all subimages together; from 4 GB on the file is a BigTIFF.
  TiffWriter(const std::string& path, std::uint64_t texel_bytes);
  ~TiffWriter();
  TiffWriter(const TiffWriter&) = delete;
  TiffWriter& operator=(const TiffWriter&) = delete;

  void add(const TiffTexels& image);
  std::uint64_t bytes() const;  ///< of the file so far
  void close();

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;
};

}  // namespace rbvh
