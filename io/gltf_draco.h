// KHR_draco_mesh_compression: a primitive's triangles and attributes in one stream.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/gltf_file.h"

namespace rbvh {

struct DracoMesh {
  std::vector<std::uint32_t> indices;
  std::map<std::string, GltfValues> attributes;
};

/// `ids`: an attribute's name and its number in the stream. Nothing (no indices) where the stream is damaged.
DracoMesh decode_draco(std::string_view bytes, const std::map<std::string, std::uint32_t>& ids);

}  // namespace rbvh
