// What a glTF file is made of: JSON, buffers and the arrays in them, whichever way these are packed.
//
// Own code, and not tinygltf's reader: that refuses the buffers without bytes that EXT_meshopt_compression
// leaves for programs that do not know it, and reads images and sizes as they come.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// An accessor's values as floats, row by row; normalised integers in [0, 1] or [-1, 1].
struct GltfValues {
  std::size_t rows = 0, columns = 0;
  std::vector<float> values;
};

/// Every index and count is checked against what is there. Throws Error(kInput).
class GltfFile {
 public:
  /// GLB or JSON. Buffers beside the file are read from its folder; `bytes` must outlive this.
  GltfFile(std::string_view bytes, const std::string& file);

  const nlohmann::json& root() const { return root_; }
  /// The element of one of the root's arrays.
  const nlohmann::json& element(const char* array, std::size_t index) const;

  GltfValues values(std::size_t accessor);
  std::vector<std::uint32_t> indices(std::size_t accessor);
  std::size_t rows(std::size_t accessor) const;
  std::string_view view(std::size_t buffer_view);
  /// Of the element of `images`: what it is called and, unless it lies beside the file, its bytes. Throws
  /// Error(kInput) and nlohmann::json::exception where it is not as glTF has it.
  TextureImage image(std::size_t index);

  [[noreturn]] void fail(const std::string& what) const;

 private:
  struct Layout;
  void read_glb(std::string_view bytes);
  void check_extensions() const;
  std::string_view buffer(std::size_t index);
  std::string read_buffer(std::size_t index);
  std::string unpack_view(const nlohmann::json& packed);
  Layout layout_of(const nlohmann::json& accessor, std::size_t accessor_index);
  template <class Store>
  void each_value(std::size_t accessor, const Store& store);

  const std::string& file_;
  std::string_view binary_;  ///< of a GLB
  std::size_t bytes_ = 0;
  nlohmann::json root_;
  std::map<std::size_t, std::string> buffers_, views_;  ///< those that are not in the file as they are
};

/// A member that is an index or a count; `otherwise` where there is none.
std::size_t gltf_number(const nlohmann::json& object, const char* key, std::size_t otherwise);
/// And where there must be one: throws nlohmann::json::exception.
std::size_t gltf_number(const nlohmann::json& object, const char* key);

inline constexpr std::size_t kNoGltfIndex = SIZE_MAX;

}  // namespace rbvh
