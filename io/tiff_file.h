// TIFF files of 16-bit texels in memory, read by libtiff, which OpenImageIO reads them by, too: a pair is
// opened without loading that library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace rbvh {

class TiffFault : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What a subimage says of itself.
struct TiffImage {
  std::uint32_t width = 0, height = 0;
  std::uint32_t channels = 0;  ///< 0: of another kind than 16-bit unsigned interleaved texels
  std::uint32_t tile_width = 0, tile_height = 0;  ///< a strip is a tile as wide as the image
  std::string description;
  std::uint64_t stored_bytes = 0;  ///< of its compressed texels
};

/// A file's subimages, one after the other. Hostile bytes are expected: no piece of memory is larger than
/// 1100 times their number. Throws TiffFault with what is wrong.
class TiffFile {
 public:
  /// `file` must outlive it. Begins with the first subimage.
  explicit TiffFile(std::span<const std::byte> file);

  const TiffImage& image() const { return image_; }
  bool next();  ///< false where there is no other
  /// width * height * channels texels of image(), where it has channels.
  std::vector<std::uint16_t> decode() const;

 private:
  struct Handle;
  std::span<const std::byte> file_;
  std::shared_ptr<Handle> handle_;
  TiffImage image_;
};

}  // namespace rbvh
