#include "io/gltf_file.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>

#include "io/input_file.h"
#include "io/max_expansion.h"
#include "io/shallow_json.h"
#include "io/text_cursor.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

using nlohmann::json;

constexpr int kMostDepth = 64;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

enum Component { kInt8 = 5120, kUint8 = 5121, kInt16 = 5122, kUint16 = 5123, kUint32 = 5125, kFloat = 5126 };

std::size_t component_bytes(std::size_t type) {
  switch (type) {
    case kInt8:
    case kUint8:
      return 1;
    case kInt16:
    case kUint16:
      return 2;
    case kUint32:
    case kFloat:
      return 4;
    default:
      return 0;
  }
}

std::size_t columns_of(const std::string& type) {
  constexpr std::pair<const char*, std::size_t> kTypes[] = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}};
  for (const auto& [name, columns] : kTypes)
    if (type == name) return columns;
  return 0;
}

template <class T>
T load(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return value;
}

float load_float(const char* at, std::size_t type, bool normalized) {
  const auto scaled = [&](double value, double largest) {
    return static_cast<float>(normalized ? std::max(value / largest, -1.0) : value);
  };
  switch (type) {
    case kInt8:
      return scaled(load<std::int8_t>(at), 127);
    case kUint8:
      return scaled(load<std::uint8_t>(at), 255);
    case kInt16:
      return scaled(load<std::int16_t>(at), 32767);
    case kUint16:
      return scaled(load<std::uint16_t>(at), 65535);
    case kUint32:
      return scaled(load<std::uint32_t>(at), 4294967295.0);
    default:
      return load<float>(at);
  }
}

std::uint32_t load_index(const char* at, std::size_t type) {
  return type == kUint8    ? load<std::uint8_t>(at)
         : type == kUint16 ? load<std::uint16_t>(at)
                           : load<std::uint32_t>(at);
}

/// Nothing where it is no base64.
bool decode_base64(std::string_view text, std::string& bytes) {
  std::uint32_t bits = 0;
  int count = 0;
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  for (const char c : text) {
    const int digit = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+' || c == '-' ? 62
                      : c == '/' || c == '_' ? 63
                                             : -1;
    if (digit < 0) return false;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    if ((count += 6) >= 8) bytes += static_cast<char>(bits >> (count -= 8));
  }
  return true;
}

std::string percent_decoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned value = 0;
    if (text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(text.data() + i + 1, text.data() + i + 3, value, 16).ptr == text.data() + i + 3) {
      decoded += static_cast<char>(value);
      i += 2;
    } else {
      decoded += text[i];
    }
  }
  return decoded;
}

const json* packed_extension(const json& view) {
  const auto extensions = view.find("extensions");
  if (extensions == view.end()) return nullptr;
  const auto packed = extensions->find("EXT_meshopt_compression");
  return packed == extensions->end() ? nullptr : &*packed;
}

}  // namespace

std::size_t gltf_number(const json& object, const char* key) {
  const json& value = object.at(key);
  if (value.is_number_unsigned()) return value.get<std::size_t>();
  const double number = value.get<double>();  // some write 3.0
  if (!(number >= 0 && number < 4294967296.0) || number != std::floor(number))
    throw json::other_error::create(500, std::string(key) + " is no index", nullptr);
  return static_cast<std::size_t>(number);
}

std::size_t gltf_number(const json& object, const char* key, std::size_t otherwise) {
  return object.contains(key) ? gltf_number(object, key) : otherwise;
}

/// Where an accessor's values lie.
struct GltfFile::Layout {
  std::size_t rows = 0, columns = 0, type = 0, stride = 0;
  bool normalized = false;
  std::string_view bytes;  ///< from the first value on; empty: all zeros
};

GltfFile::GltfFile(std::string_view bytes, const std::string& file) : file_(file), bytes_(bytes.size()) {
  std::string_view text = bytes;
  if (bytes.starts_with("glTF")) {
    read_glb(bytes);
  } else {
    std::size_t byte = 0;
    root_ = parse_shallow_json(text, kMostDepth, &byte);
    if (root_.is_discarded())
      throw Error(ErrorKind::kInput, file_, FilePlace{"byte", byte}, "is no JSON from here on");
  }
  if (!root_.is_object() || !root_.contains("asset")) fail("is JSON, but no glTF");
  const json version = root_["asset"].value("version", json("2.0"));
  if (!version.is_string() || !version.get<std::string>().starts_with("2"))
    fail("is glTF of the version " + shown(version.dump(-1, ' ', true, json::error_handler_t::replace)) +
         "; 2.0 is read");
  check_extensions();
}

void GltfFile::read_glb(std::string_view bytes) {
  constexpr std::size_t kHeader = 12, kChunk = 8;
  if (bytes.size() < kHeader + kChunk) fail("the file is cut inside its header");
  if (load<std::uint32_t>(bytes.data() + 4) != 2) fail("is a GLB of another version than 2");
  const std::size_t length = load<std::uint32_t>(bytes.data() + 8);
  if (length > bytes.size())
    throw Error(ErrorKind::kInput, file_, FilePlace{"byte", bytes.size()},
                "the file is cut: its header promises " + std::to_string(length) + " bytes");
  for (std::size_t at = kHeader; at + kChunk <= length;) {
    const std::size_t size = load<std::uint32_t>(bytes.data() + at);
    const auto kind = load<std::uint32_t>(bytes.data() + at + 4);
    at += kChunk;
    if (size > length - at) fail("a chunk is longer than the file");
    const std::string_view chunk = bytes.substr(at, size);
    if (kind == kJsonChunk && root_.is_null()) {
      root_ = parse_shallow_json(chunk, kMostDepth);
      if (root_.is_discarded()) fail("its JSON is malformed");
    } else if (kind == kBinaryChunk && binary_.empty()) {
      binary_ = chunk;
    }
    at += size;
  }
}

void GltfFile::check_extensions() const {
  if (!root_.contains("extensionsRequired")) return;
  for (const json& each : root_["extensionsRequired"]) {
    const auto name = each.get<std::string>();
    bool known = false;
    for (const char* geometry :
         {"KHR_mesh_quantization", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing"})
      known |= name == geometry;
#ifdef RBVH_DRACO
    known |= name == "KHR_draco_mesh_compression";
#endif
    for (const char* looks :
         {"KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "MSFT_texture_"})
      known |= name.starts_with(looks);
    if (!known) fail("needs the extension " + shown(name) + ", which is not known here");
  }
}

void GltfFile::fail(const std::string& what) const { throw Error(ErrorKind::kInput, file_, what); }

const json& GltfFile::element(const char* array, std::size_t index) const {
  const auto found = root_.find(array);
  if (found == root_.end() || !found->is_array() || index >= found->size())
    fail("there is no element " + std::to_string(index) + " of its " + array);
  return (*found)[index];
}

std::string GltfFile::read_buffer(std::size_t index) {
  const json& described = element("buffers", index);
  const auto uri = described.at("uri").get<std::string>();
  std::string bytes;
  if (uri.starts_with("data:")) {
    const std::size_t comma = uri.find(";base64,");
    if (comma == std::string::npos || !decode_base64(std::string_view(uri).substr(comma + 8), bytes))
      fail("buffer " + std::to_string(index) + " is no base64");
    return bytes;
  }
  const std::filesystem::path name = percent_decoded(uri);
  const bool leaves = std::find(name.begin(), name.end(), "..") != name.end();
  if (name.is_absolute() || leaves || uri.find("://") != std::string::npos)
    fail("buffer " + std::to_string(index) + " lies outside its folder: " + shown(uri));
  const std::string path = (std::filesystem::path(file_).parent_path() / name).string();
  if (!std::filesystem::is_regular_file(path)) fail("its buffer " + shown(uri) + " is not there");
  return std::string(read_input(path).view());
}

TextureImage GltfFile::image(std::size_t index) {
  const json& described = element("images", index);
  TextureImage image;
  image.name = described.value("name", "image " + std::to_string(index));
  if (described.contains("bufferView")) {
    image.file = view(gltf_number(described, "bufferView"));
    return image;
  }
  const auto uri = described.at("uri").get<std::string>();
  if (!uri.starts_with("data:")) {
    image.name = percent_decoded(uri);
    return image;
  }
  const std::size_t comma = uri.find(";base64,");
  if (comma == std::string::npos || !decode_base64(std::string_view(uri).substr(comma + 8), image.file))
    fail("image " + std::to_string(index) + " is no base64");
  return image;
}

std::string_view GltfFile::buffer(std::size_t index) {
  const json& described = element("buffers", index);
  std::string_view bytes = binary_;
  if (described.contains("uri")) {
    auto found = buffers_.find(index);
    if (found == buffers_.end()) found = buffers_.emplace(index, read_buffer(index)).first;
    bytes = found->second;
  } else if (index != 0) {
    fail("buffer " + std::to_string(index) + " has no bytes");
  }
  const std::size_t size = gltf_number(described, "byteLength");
  if (size > bytes.size())
    fail("buffer " + std::to_string(index) + " is cut: " + std::to_string(size) + " bytes are promised, " +
         std::to_string(bytes.size()) + " are there");
  return bytes.substr(0, size);
}

/// EXT_meshopt_compression.
std::string GltfFile::unpack_view(const json& packed) {
  const std::string_view all = buffer(gltf_number(packed, "buffer"));
  const std::size_t offset = gltf_number(packed, "byteOffset", 0), size = gltf_number(packed, "byteLength");
  const std::size_t count = gltf_number(packed, "count"), stride = gltf_number(packed, "byteStride");
  if (offset > all.size() || size > all.size() - offset) fail("compressed bytes lie outside their buffer");
  const auto mode = packed.at("mode").get<std::string>(),
             filter = packed.value("filter", std::string("NONE"));
  const bool is_vertices = mode == "ATTRIBUTES";
  if (stride == 0 || stride > 256 || (is_vertices ? stride % 4 != 0 : stride != 2 && stride != 4) ||
      (mode == "TRIANGLES" && count % 3 != 0) || count > kMaxExpansion * size / stride)
    fail("compressed bytes have impossible counts");
  std::string bytes(count * stride, '\0');
  const auto* from = reinterpret_cast<const unsigned char*>(all.data() + offset);
  int failed = 1;
  if (is_vertices)
    failed = meshopt_decodeVertexBuffer(bytes.data(), count, stride, from, size);
  else if (mode == "TRIANGLES")
    failed = meshopt_decodeIndexBuffer(bytes.data(), count, stride, from, size);
  else if (mode == "INDICES")
    failed = meshopt_decodeIndexSequence(bytes.data(), count, stride, from, size);
  if (failed != 0) fail("its compressed bytes (meshopt) are damaged, or of a newer kind");
  // The filters work on groups of four.
  const std::size_t padded = (count + 3) / 4 * 4;
  bytes.resize(padded * stride);
  if (filter == "OCTAHEDRAL" && (stride == 4 || stride == 8))
    meshopt_decodeFilterOct(bytes.data(), padded, stride);
  else if (filter == "QUATERNION" && stride == 8)
    meshopt_decodeFilterQuat(bytes.data(), padded, stride);
  else if (filter == "EXPONENTIAL" && is_vertices)
    meshopt_decodeFilterExp(bytes.data(), padded, stride);
  else if (filter != "NONE")
    fail("compressed bytes have an unknown filter");
  bytes.resize(count * stride);
  return bytes;
}

std::string_view GltfFile::view(std::size_t index) {
  const json& described = element("bufferViews", index);
  if (const json* packed = packed_extension(described)) {
    auto found = views_.find(index);
    if (found == views_.end()) found = views_.emplace(index, unpack_view(*packed)).first;
    return found->second;
  }
  const std::string_view all = buffer(gltf_number(described, "buffer"));
  const std::size_t offset = gltf_number(described, "byteOffset", 0),
                    size = gltf_number(described, "byteLength");
  if (offset > all.size() || size > all.size() - offset)
    fail("buffer view " + std::to_string(index) + " lies outside its buffer");
  return all.substr(offset, size);
}

GltfFile::Layout GltfFile::layout_of(const json& accessor, std::size_t index) {
  const auto refuse = [&](const std::string& what) {
    fail("accessor " + std::to_string(index) + " " + what);
  };
  Layout layout;
  layout.rows = gltf_number(accessor, "count");
  layout.columns = columns_of(accessor.at("type").get<std::string>());
  layout.type = gltf_number(accessor, "componentType");
  layout.normalized = accessor.value("normalized", false);
  const std::size_t width = layout.columns * component_bytes(layout.type);
  if (width == 0 || layout.rows == 0) refuse("has no values, or of an unknown type");
  if (!accessor.contains("bufferView")) {
    if (layout.rows > bytes_) refuse("has more values than the file has bytes");
    return layout;
  }
  const std::size_t view_index = gltf_number(accessor, "bufferView");
  layout.bytes = view(view_index);
  const json& described = element("bufferViews", view_index);
  layout.stride = gltf_number(described, "byteStride", width);
  const std::size_t offset = gltf_number(accessor, "byteOffset", 0);
  if (layout.stride < width || layout.stride > 65536 || offset > layout.bytes.size() ||
      layout.bytes.size() - offset < width ||
      (layout.bytes.size() - offset - width) / layout.stride < layout.rows - 1)
    refuse("lies outside its buffer view");
  layout.bytes.remove_prefix(offset);
  return layout;
}

/// Calls store(at, type, normalized, row, column) for all values, those of a sparse accessor last.
template <class Store>
void GltfFile::each_value(std::size_t index, const Store& store) {
  const json& accessor = element("accessors", index);
  const Layout layout = layout_of(accessor, index);
  const std::size_t size = component_bytes(layout.type);
  if (!layout.bytes.empty())
    for (std::size_t row = 0; row < layout.rows; ++row)
      for (std::size_t column = 0; column < layout.columns; ++column)
        store(layout.bytes.data() + row * layout.stride + column * size, layout, row, column);
  if (!accessor.contains("sparse")) return;
  const json& sparse = accessor["sparse"];
  const std::size_t count = gltf_number(sparse, "count");
  const auto part = [&](const char* name, std::size_t width) {
    const json& described = sparse.at(name);
    const std::string_view bytes = view(gltf_number(described, "bufferView"));
    const std::size_t offset = gltf_number(described, "byteOffset", 0);
    if (width == 0 || offset > bytes.size() || (bytes.size() - offset) / width < count)
      fail("accessor " + std::to_string(index) + " has sparse values outside their buffer view");
    return bytes.data() + offset;
  };
  const std::size_t index_type = gltf_number(sparse.at("indices"), "componentType");
  const std::size_t index_size = component_bytes(index_type);
  const char* rows = part("indices", index_size);
  const char* values = part("values", layout.columns * size);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t row = load_index(rows + i * index_size, index_type);
    if (row >= layout.rows) fail("accessor " + std::to_string(index) + " has a sparse value beyond its end");
    for (std::size_t column = 0; column < layout.columns; ++column)
      store(values + (i * layout.columns + column) * size, layout, row, column);
  }
}

std::size_t GltfFile::rows(std::size_t accessor) const {
  return gltf_number(element("accessors", accessor), "count");
}

GltfValues GltfFile::values(std::size_t accessor) {
  const Layout layout = layout_of(element("accessors", accessor), accessor);
  GltfValues all{layout.rows, layout.columns, std::vector<float>(layout.rows * layout.columns)};
  each_value(accessor, [&](const char* at, const Layout& of, std::size_t row, std::size_t column) {
    all.values[row * of.columns + column] = load_float(at, of.type, of.normalized);
  });
  return all;
}

std::vector<std::uint32_t> GltfFile::indices(std::size_t accessor) {
  const Layout layout = layout_of(element("accessors", accessor), accessor);
  if (layout.columns != 1 || layout.type == kFloat)
    fail("accessor " + std::to_string(accessor) + " has no indices");
  std::vector<std::uint32_t> all(layout.rows);
  each_value(accessor, [&](const char* at, const Layout& of, std::size_t row, std::size_t) {
    all[row] = load_index(at, of.type);
  });
  return all;
}

}  // namespace rbvh
