#include "io/gltf_textures.h"

#include <cmath>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

using nlohmann::json;

const json* extension(const json& of, const char* name) {
  const auto extensions = of.find("extensions");
  if (extensions == of.end()) return nullptr;
  const auto found = extensions->find(name);
  return found == extensions->end() ? nullptr : &*found;
}

TextureWrap wrap_of(const json& sampler, const char* key) {
  constexpr std::size_t kClamp = 33071, kMirror = 33648, kRepeat = 10497;
  const std::size_t how = gltf_number(sampler, key, kRepeat);
  return how == kClamp ? TextureWrap::kClamp : how == kMirror ? TextureWrap::kMirror : TextureWrap::kRepeat;
}

/// `transform`: KHR_texture_transform, or nullptr.
std::array<std::array<float, 3>, 2> rows_of(const json* transform) {
  std::array<double, 2> offset{0, 0}, scale{1, 1};
  double angle = 0;
  if (transform != nullptr) {
    offset = transform->value("offset", offset);
    scale = transform->value("scale", scale);
    angle = transform->value("rotation", angle);
  }
  const double c = std::cos(angle), s = std::sin(angle);
  const auto row = [](double u, double v, double more) {
    return std::array{static_cast<float>(u), static_cast<float>(v), static_cast<float>(more)};
  };
  return {row(c * scale[0], s * scale[1], offset[0]), row(s * scale[0], -c * scale[1], 1 - offset[1])};
}

}  // namespace

GltfTextureUse GltfTextures::find(const json& shown) {
  const std::size_t index = gltf_number(shown, "index");
  const json* transform = extension(shown, "KHR_texture_transform");
  std::size_t set = gltf_number(shown, "texCoord", 0);
  if (transform != nullptr) set = gltf_number(*transform, "texCoord", set);
  GltfTextureUse use{.coordinates = "TEXCOORD_" + std::to_string(set), .transform = rows_of(transform)};
  if (const auto known = numbers_.find(index); known != numbers_.end()) {
    use.texture = known->second;
    return use;
  }
  const json& described = gltf_.element("textures", index);
  const json* webp = extension(described, "EXT_texture_webp");
  if (webp == nullptr && !described.contains("source")) gltf_.fail("its image is of an unknown kind");
  const std::size_t source = gltf_number(webp != nullptr ? *webp : described, "source");
  auto& image = images_[source];
  if (!image) image = std::make_shared<const TextureImage>(gltf_.image(source));
  Texture texture{.image = image, .times_colors = true};
  if (described.contains("sampler")) {
    const json& sampler = gltf_.element("samplers", gltf_number(described, "sampler"));
    texture.wrap_u = wrap_of(sampler, "wrapS");
    texture.wrap_v = wrap_of(sampler, "wrapT");
  }
  use.texture = numbers_[index] = static_cast<std::uint32_t>(textures.size());
  textures.push_back(std::move(texture));
  return use;
}

std::optional<GltfTextureUse> GltfTextures::of_material(std::size_t material) {
  const auto [known, is_new] = of_materials_.try_emplace(material);
  if (!is_new) return known->second;
  const json& described = gltf_.element("materials", material);
  const auto looks = described.find("pbrMetallicRoughness");
  if (looks == described.end() || !looks->contains("baseColorTexture")) return {};
  try {
    known->second = find((*looks)["baseColorTexture"]);
  } catch (const Error& error) {
    faults[material] = error.message();
  } catch (const json::exception&) {
    faults[material] = "is not as glTF has it";
  }
  return known->second;
}

}  // namespace rbvh
