#include "io/atlas_file.h"

#include <algorithm>

#include "io/max_expansion.h"
#include "io/tiff_file.h"
#include "io/tiff_writer.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/text.h"
#include "pipeline/rbvh/leaf_primitives.h"

namespace rbvh {
namespace {

std::string subimage_name(const Level& level, const Layer& layer) { return level.name + "." + layer.name; }

/// For each row of each tile but the first, from the last (`adds` false) or the first on: takes away, or
/// adds, the row above, modulo 65536.
void difference_rows(const Level& level, std::vector<std::uint16_t>& texels, bool adds) {
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  for (std::size_t k = 0; k < level.leaves.size(); ++k) {
    if (firsts[k] != RBVH_NO_LEAF) continue;
    const RbvhLeaf& leaf = level.leaves[k];
    for (std::uint32_t i = 1; i < leaf.height; ++i) {
      const std::uint32_t y = adds ? i : leaf.height - i;
      std::uint16_t* const row = texels.data() + std::size_t{leaf.y + y} * level.atlas_width + leaf.x;
      const std::uint16_t* const above = row - level.atlas_width;
      for (std::uint32_t x = 0; x < leaf.width; ++x)
        row[x] = static_cast<std::uint16_t>(adds ? row[x] + above[x] : row[x] - above[x]);
    }
  }
}

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(ErrorKind::kInput, path, one_line(why) + "; build the pair again");
}

}  // namespace

std::vector<std::uint64_t> write_atlas(const std::string& temporary_path, const std::string& path,
                                       const Rbvh& rbvh) {
  std::uint64_t values = 0;
  for (const Level& level : rbvh.levels)
    for (const Layer& layer : level.layers) values += layer.texels.size();
  std::vector<std::uint64_t> level_bytes;
  try {
    TiffWriter tiff(temporary_path, values * sizeof(std::uint16_t));
    std::uint64_t before = 0;
    for (const Level& level : rbvh.levels) {
      for (const Layer& layer : level.layers) {
        const auto [width, height] = atlas_size(level, layer);
        std::vector<std::uint16_t> heights;
        if (layer_kind(layer.name) == LayerKind::kHeight) {
          heights = layer.texels;
          difference_rows(level, heights, false);
        }
        tiff.add({width, height, layer.channels, subimage_name(level, layer),
                  heights.empty() ? layer.texels : heights});
      }
      const std::uint64_t now = tiff.bytes();
      level_bytes.push_back(now - before);
      before = now;
    }
    tiff.close();
  } catch (const TiffFault& fault) {
    throw Error(ErrorKind::kFailure, path, "cannot be written: " + one_line(fault.what()));
  }
  return level_bytes;
}

void decode_atlas(std::span<const std::byte> file, const std::string& path, StoredHeights stored, Rbvh& rbvh,
                  bool among_others) {
  std::uint64_t values = 0;
  for (const Level& level : rbvh.levels)
    for (const Layer& layer : level.layers) {
      const auto [width, height] = atlas_size(level, layer);
      values += std::uint64_t{width} * height * layer.channels;
    }
  if (values * sizeof(std::uint16_t) > kMaxExpansion * file.size())
    refuse(path, "is too small (" + std::to_string(file.size()) + " bytes) for the " +
                     std::to_string(values) + " texels that its hierarchy claims");

  try {
    TiffFile tiff(file);
    std::size_t subimage = 0;
    for (Level& level : rbvh.levels)
      for (Layer& layer : level.layers) {
        const std::string name = subimage_name(level, layer);
        if (subimage++ > 0 && !tiff.next()) refuse(path, "has no subimage " + name);
        while (among_others && tiff.image().description != name)
          if (!tiff.next()) refuse(path, "has no subimage " + name);
        const TiffImage& image = tiff.image();
        if (image.description != name)
          refuse(path, "has, as subimage " + std::to_string(subimage - 1) + ", not " + name);
        // Checked against the hierarchy before any memory is reserved.
        const auto [width, height] = atlas_size(level, layer);
        if (image.width != width || image.height != height || image.channels != layer.channels)
          refuse(path, "subimage " + name + " is not the " + std::to_string(width) + " x " +
                           std::to_string(height) + " texels of 16 bits that its hierarchy claims");
        layer.texels = tiff.decode();
        layer.stored_bytes = image.stored_bytes;
        if (layer_kind(layer.name) == LayerKind::kHeight && stored == StoredHeights::kDifferences)
          difference_rows(level, layer.texels, true);
      }
    if (!among_others && tiff.next()) refuse(path, "has more subimages than its hierarchy has layers");
  } catch (const TiffFault& fault) {
    refuse(path, std::string("is no TIFF that can be decoded (") + fault.what() + ")");
  }
}

}  // namespace rbvh
