// TIFF 6.0 (Adobe 1992) and BigTIFF: a header, then a chain of directories of tags. OpenImageIO does not tell
// what a subimage takes; the tag TileByteCounts does.
#include "io/tiff_bytes.h"

#include <optional>

namespace rbvh {
namespace {

constexpr std::uint64_t kTileByteCounts = 325;
constexpr std::size_t kMostSubimages = 1024;

class Reader {
 public:
  explicit Reader(std::span<const std::byte> file) : file_(file) {}

  /// Little-endian.
  std::optional<std::uint64_t> read(std::uint64_t at, std::uint64_t bytes) const {
    if (at > file_.size() || bytes > file_.size() - at) return std::nullopt;
    std::uint64_t value = 0;
    for (std::uint64_t i = bytes; i-- > 0;)
      value = value << 8 | std::to_integer<std::uint64_t>(file_[at + i]);
    return value;
  }

 private:
  std::span<const std::byte> file_;
};

/// Where the two kinds of file differ.
struct Widths {
  std::uint64_t offset, entries, entry;
};
constexpr Widths kClassic = {4, 2, 12}, kBig = {8, 8, 20};

/// 0: no integer type.
std::uint64_t type_bytes(std::uint64_t type) { return type == 3 ? 2 : type == 4 ? 4 : type == 16 ? 8 : 0; }

/// The sum of a tag's values.
std::optional<std::uint64_t> sum_of(const Reader& reader, const Widths& widths, std::uint64_t entry) {
  const auto type = reader.read(entry + 2, 2), count = reader.read(entry + 4, widths.offset);
  if (!type || !count || type_bytes(*type) == 0) return std::nullopt;
  const std::uint64_t size = type_bytes(*type);
  std::uint64_t at = entry + 4 + widths.offset;
  if (*count > widths.offset / size) {  // else they are here
    const auto elsewhere = reader.read(at, widths.offset);
    if (!elsewhere) return std::nullopt;
    at = *elsewhere;
  }
  std::uint64_t sum = 0;
  for (std::uint64_t i = 0; i < *count; ++i) {
    const auto value = reader.read(at + i * size, size);
    if (!value) return std::nullopt;
    sum += *value;
  }
  return sum;
}

}  // namespace

std::vector<std::uint64_t> tiff_subimage_bytes(std::span<const std::byte> file) {
  const Reader reader(file);
  const auto magic = reader.read(0, 4);
  const bool is_big = magic == 0x002b4949u;
  if (!is_big && magic != 0x002a4949u) return {};
  const Widths& widths = is_big ? kBig : kClassic;
  std::vector<std::uint64_t> bytes;
  std::optional<std::uint64_t> directory = reader.read(is_big ? 8 : 4, widths.offset);
  while (directory && *directory != 0 && bytes.size() < kMostSubimages) {
    const auto entries = reader.read(*directory, widths.entries);
    if (!entries || *entries > file.size() / widths.entry) break;
    const std::uint64_t first = *directory + widths.entries;
    std::optional<std::uint64_t> sum;
    for (std::uint64_t i = 0; i < *entries; ++i)
      if (reader.read(first + i * widths.entry, 2) == kTileByteCounts)
        sum = sum_of(reader, widths, first + i * widths.entry);
    if (!sum) break;
    bytes.push_back(*sum);
    directory = reader.read(first + *entries * widths.entry, widths.offset);
  }
  return bytes;
}

}  // namespace rbvh
