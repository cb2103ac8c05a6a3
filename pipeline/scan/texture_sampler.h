// What textures show at places on a mesh, averaged over what a ray or a texel covers (Williams 1983).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// An image and its smaller versions, each half as wide and high as the one before, down to one texel.
struct TexturePyramid {
  struct Level {
    std::uint32_t width = 0, height = 0;
    const Color8* texels = nullptr;
  };
  std::vector<Level> levels;
  std::vector<std::vector<Color8>> smaller;   ///< the texels of all but the first
  std::shared_ptr<const TextureImage> image;  ///< those of the first
};

/// Averaged in linear light, by area.
TexturePyramid make_pyramid(std::shared_ptr<const TextureImage> image);

/// Of a mesh with textures, which must outlive it.
class TextureSampler {
 public:
  explicit TextureSampler(const Scan& mesh);

  /// In linear light, at the place of a face whose corners weigh so much; averaged over `width` (scan units;
  /// 0: as fine as the image is). Nothing where the face shows no texture.
  std::optional<Vec3f> color(std::size_t face, const std::array<float, 3>& weights, float width) const;

 private:
  const Scan& mesh_;
  std::vector<std::shared_ptr<const TexturePyramid>> pyramids_;  ///< of each texture
};

}  // namespace rbvh
