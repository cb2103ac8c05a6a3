// The images that a glTF file's materials show.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/gltf_file.h"
#include "rbvh/scan.h"

namespace rbvh {

/// How a primitive shows a texture.
struct GltfTextureUse {
  std::uint32_t texture = 0;  ///< of GltfTextures::textures
  std::string coordinates;    ///< the attribute's name
  /// From its values, v down, to places in the texture, v up (KHR_texture_transform): rows u and v.
  std::array<std::array<float, 3>, 2> transform{};
};

class GltfTextures {
 public:
  explicit GltfTextures(GltfFile& gltf) : gltf_(gltf) {}

  /// The base colour's of a material; nothing where it has none, or one that is not as glTF has it.
  std::optional<GltfTextureUse> of_material(std::size_t material);

  std::vector<Texture> textures;
  std::map<std::size_t, std::string> faults;  ///< of materials

 private:
  GltfTextureUse find(const nlohmann::json& shown);

  GltfFile& gltf_;
  std::map<std::size_t, std::shared_ptr<const TextureImage>> images_;
  std::map<std::size_t, std::uint32_t> numbers_;  ///< of glTF's textures
  std::map<std::size_t, std::optional<GltfTextureUse>> of_materials_;
};

}  // namespace rbvh
