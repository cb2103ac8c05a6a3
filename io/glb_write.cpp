// Binary glTF 2.0. A viewer takes +Y for up, so a scan of another axis is turned by its node, and the numbers
// stay the scan's.
#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <ostream>
#include <streambuf>
#include <tuple>

#include "io/foreign_image.h"
#include "io/output_file.h"
#include "io/png.h"
#include "pipeline/base/error.h"
#include "rbvh/io.h"

namespace rbvh {
namespace {

using Uv = std::array<float, 2>;

/// Hands what is written to an output file.
class OutputBuffer : public std::streambuf {
 public:
  explicit OutputBuffer(OutputFile& file) : file_(file) {}

 protected:
  std::streamsize xsputn(const char* bytes, std::streamsize count) override {
    file_.write(std::string_view(bytes, static_cast<std::size_t>(count)));
    return count;
  }
  int overflow(int c) override {
    if (c != traits_type::eof()) {
      const char byte = traits_type::to_char_type(c);
      file_.write(std::string_view(&byte, 1));
    }
    return traits_type::not_eof(c);
  }

 private:
  OutputFile& file_;
};

/// glTF's vertex colours are linear.
std::uint8_t linear(std::uint8_t srgb) {
  const double c = srgb / 255.0;
  return static_cast<std::uint8_t>(
      std::lround(255 * (c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4))));
}

/// Appends an array to the model's one buffer; returns its accessor.
template <class T>
int add_array(tinygltf::Model& model, const std::vector<T>& values, int type, int component, int target) {
  std::vector<unsigned char>& bytes = model.buffers[0].data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = values.size() * sizeof(T);
  view.target = target;
  const auto* first = reinterpret_cast<const unsigned char*>(values.data());
  bytes.insert(bytes.end(), first, first + view.byteLength);
  tinygltf::Accessor accessor;
  accessor.bufferView = static_cast<int>(model.bufferViews.size());
  accessor.componentType = component;
  accessor.type = type;
  accessor.count =
      values.size() * sizeof(T) /
      static_cast<std::size_t>(tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(component)) *
                               tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type)));
  model.bufferViews.push_back(std::move(view));
  model.accessors.push_back(std::move(accessor));
  return static_cast<int>(model.accessors.size() - 1);
}

tinygltf::Value number(double value) { return tinygltf::Value(value); }

/// Faces that show one texture, or none. Where it parts a vertex's faces, they have vertices of their own.
struct Part {
  Scan scan;
  std::vector<Uv> places;  ///< of the vertices, v down
  std::uint32_t texture = FaceTexture::kNone;
};

/// The faces of that texture.
Part part_of(const Scan& scan, std::uint32_t texture) {
  struct Corner {
    std::uint32_t vertex;
    Uv place;
    std::size_t number;  // among all corners of the part
    auto key() const { return std::tie(vertex, place); }
  };
  std::vector<Corner> corners;
  for (std::size_t i = 0; i < scan.triangles.size(); ++i) {
    const FaceTexture& face = scan.face_textures[i];
    if (face.texture != texture) continue;
    for (std::size_t c = 0; c < 3; ++c)
      corners.push_back({scan.triangles[i][c], {face.corners[c][0], 1 - face.corners[c][1]}, corners.size()});
  }
  Part part;
  part.texture = texture;
  part.scan.triangles.resize(corners.size() / 3);
  std::sort(corners.begin(), corners.end(),
            [](const Corner& a, const Corner& b) { return a.key() < b.key(); });
  const bool is_textured = texture != FaceTexture::kNone;
  const bool has_colors = !scan.colors.empty() && (!is_textured || scan.textures[texture].times_colors);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Corner& corner = corners[i];
    if (i == 0 || corner.key() != corners[i - 1].key()) {
      part.scan.positions.push_back(scan.positions[corner.vertex]);
      if (!scan.normals.empty()) part.scan.normals.push_back(scan.normals[corner.vertex]);
      if (has_colors) part.scan.colors.push_back(scan.colors[corner.vertex]);
      if (is_textured) part.places.push_back(corner.place);
    }
    part.scan.triangles[corner.number / 3][corner.number % 3] =
        static_cast<std::uint32_t>(part.scan.positions.size() - 1);
  }
  return part;
}

void add_primitive(tinygltf::Model& model, const Scan& scan, const std::vector<Uv>& places, int material) {
  tinygltf::Primitive primitive;
  primitive.mode = scan.is_cloud() ? TINYGLTF_MODE_POINTS : TINYGLTF_MODE_TRIANGLES;
  primitive.material = material;
  const auto add_vertices = [&](const auto& values, int type, int component) {
    return add_array(model, values, type, component, TINYGLTF_TARGET_ARRAY_BUFFER);
  };
  const int positions = add_vertices(scan.positions, TINYGLTF_TYPE_VEC3, TINYGLTF_COMPONENT_TYPE_FLOAT);
  Bounds3f box;
  for (const Vec3f& p : scan.positions) box.add(p);
  const auto corner = [](Vec3f p) {
    return std::vector<double>{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
  };
  model.accessors.back().minValues = corner(box.lo);
  model.accessors.back().maxValues = corner(box.hi);
  primitive.attributes["POSITION"] = positions;
  if (!scan.normals.empty())
    primitive.attributes["NORMAL"] =
        add_vertices(scan.normals, TINYGLTF_TYPE_VEC3, TINYGLTF_COMPONENT_TYPE_FLOAT);
  if (!places.empty())
    primitive.attributes["TEXCOORD_0"] =
        add_vertices(places, TINYGLTF_TYPE_VEC2, TINYGLTF_COMPONENT_TYPE_FLOAT);
  if (!scan.colors.empty()) {
    std::vector<std::array<std::uint8_t, 4>> colors;  // opaque: vertices' data begin at multiples of 4 bytes
    for (const Color8& c : scan.colors) colors.push_back({linear(c[0]), linear(c[1]), linear(c[2]), 255});
    primitive.attributes["COLOR_0"] =
        add_vertices(colors, TINYGLTF_TYPE_VEC4, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE);
    model.accessors.back().normalized = true;
  }
  if (!scan.radii.empty())
    primitive.attributes["_RADIUS"] =
        add_vertices(scan.radii, TINYGLTF_TYPE_SCALAR, TINYGLTF_COMPONENT_TYPE_FLOAT);
  if (!scan.is_cloud())
    primitive.indices = add_array(model, scan.triangles, TINYGLTF_TYPE_SCALAR,
                                  TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  model.meshes[0].primitives.push_back(primitive);
}

/// glTF knows PNG and JPEG; others become PNG.
int add_image(tinygltf::Model& model, const TextureImage& image) {
  const std::string_view format = image_format(image.file) != nullptr ? image_format(image.file) : "";
  const bool is_jpeg = format == "jpeg";
  std::vector<unsigned char>& bytes = model.buffers[0].data;
  bytes.resize((bytes.size() + 3) / 4 * 4);
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  if (is_jpeg || format == "png") {
    bytes.insert(bytes.end(), image.file.begin(), image.file.end());
  } else {
    const std::vector<std::byte> png = encode_png(
        image.width, image.height, 3, {image.texels.data()->data(), 3 * image.texels.size()}, true);
    const auto* first = reinterpret_cast<const unsigned char*>(png.data());
    bytes.insert(bytes.end(), first, first + png.size());
  }
  view.byteLength = bytes.size() - view.byteOffset;
  bytes.resize((bytes.size() + 3) / 4 * 4);
  tinygltf::Image made;
  made.bufferView = static_cast<int>(model.bufferViews.size());
  made.mimeType = is_jpeg ? "image/jpeg" : "image/png";
  model.bufferViews.push_back(std::move(view));
  model.images.push_back(std::move(made));
  return static_cast<int>(model.images.size() - 1);
}

tinygltf::Material plain_material() {
  tinygltf::Material material;
  material.doubleSided = true;
  material.pbrMetallicRoughness.metallicFactor = 0;
  return material;
}

/// A material, a texture and a sampler for each of the scan's textures.
void add_textures(tinygltf::Model& model, const Scan& scan) {
  std::map<const TextureImage*, int> images;
  constexpr int kWraps[] = {TINYGLTF_TEXTURE_WRAP_REPEAT, TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT,
                            TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE};
  for (std::size_t i = 0; i < scan.textures.size(); ++i) {
    const Texture& texture = scan.textures[i];
    const auto [image, is_new] = images.try_emplace(texture.image.get());
    if (is_new) image->second = add_image(model, *texture.image);
    tinygltf::Sampler sampler;
    sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
    sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
    sampler.wrapS = kWraps[static_cast<int>(texture.wrap_u)];
    sampler.wrapT = kWraps[static_cast<int>(texture.wrap_v)];
    model.samplers.push_back(sampler);
    tinygltf::Texture made;
    made.source = image->second;
    made.sampler = static_cast<int>(i);
    model.textures.push_back(made);
    tinygltf::Material material = plain_material();
    material.pbrMetallicRoughness.baseColorTexture.index = static_cast<int>(i);
    model.materials.push_back(material);
  }
}

tinygltf::Model model_of(const Scan& scan, const Vec3d& up) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "rbvh";
  tinygltf::Value::Object extras;
  if (scan.shift != Vec3d{})  // original coordinates are the positions plus this
    extras["rbvh_shift"] = tinygltf::Value(
        tinygltf::Value::Array{number(scan.shift.x), number(scan.shift.y), number(scan.shift.z)});
  if (!scan.units.empty()) extras["rbvh_units"] = tinygltf::Value(scan.units);
  if (!extras.empty()) model.asset.extras = tinygltf::Value(extras);
  model.buffers.emplace_back();
  model.meshes.emplace_back();
  if (scan.textures.empty()) {
    add_primitive(model, scan, {}, 0);
    model.materials.push_back(plain_material());
  } else {
    add_textures(model, scan);
    for (std::uint32_t texture = 0; texture <= scan.textures.size(); ++texture) {
      const bool is_last = texture == scan.textures.size();
      const Part part = part_of(scan, is_last ? FaceTexture::kNone : texture);
      if (part.scan.triangles.empty()) continue;
      add_primitive(model, part.scan, part.places, static_cast<int>(texture));
      if (is_last) model.materials.push_back(plain_material());
    }
  }
  tinygltf::Node node;
  node.mesh = 0;
  if (up == Vec3d{0, 0, 1})
    node.rotation = {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)};  // about x, by -90 degrees
  model.nodes.push_back(node);
  tinygltf::Scene scene;
  scene.nodes = {0};
  model.scenes.push_back(scene);
  model.defaultScene = 0;
  return model;
}

}  // namespace

void write_glb(const std::string& path, const Scan& scan, const Vec3d& up, bool overwrite) {
  OutputFile out(path, overwrite);
  // The header's length, of the whole file, has 32 bits.
  std::uint64_t bytes = scan.positions.size() * 44 + scan.triangles.size() * sizeof(Triangle);
  if (!scan.textures.empty()) bytes += scan.triangles.size() * 3 * 36;  // if no vertices are shared
  for (const Texture& texture : scan.textures)
    bytes += std::max(texture.image->file.size(), 3 * texture.image->texels.size());
  if (bytes > std::numeric_limits<std::uint32_t>::max() - 65536u)
    throw Error(ErrorKind::kFailure, path, "a GLB holds at most 4 GB; write a PLY, or a coarser level");
  const tinygltf::Model model = model_of(scan, up);
  OutputBuffer buffer(out);
  std::ostream stream(&buffer);
  stream.exceptions(std::ios::badbit);  // passes on the file's own error
  if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, stream, false, true))
    throw Error(ErrorKind::kFailure, path, "the scan cannot be written as a GLB");
  out.commit();
}

}  // namespace rbvh
