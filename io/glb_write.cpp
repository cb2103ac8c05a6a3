// Binary glTF 2.0. A viewer takes +Y for up, so a scan of another axis is turned by its node, and the numbers
// stay the scan's.
#include <tiny_gltf.h>

#include <cmath>
#include <limits>
#include <ostream>
#include <streambuf>

#include "io/output_file.h"
#include "pipeline/base/error.h"
#include "rbvh/io.h"

namespace rbvh {
namespace {

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

tinygltf::Model model_of(const Scan& scan, const Vec3d& up) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "rbvh";
  if (scan.shift != Vec3d{})  // original coordinates are the positions plus this
    model.asset.extras = tinygltf::Value(tinygltf::Value::Object{
        {"rbvh_shift", tinygltf::Value(tinygltf::Value::Array{number(scan.shift.x), number(scan.shift.y),
                                                              number(scan.shift.z)})}});
  model.buffers.emplace_back();
  tinygltf::Primitive primitive;
  primitive.mode = scan.is_cloud() ? TINYGLTF_MODE_POINTS : TINYGLTF_MODE_TRIANGLES;
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
  tinygltf::Material material;
  material.doubleSided = true;
  material.pbrMetallicRoughness.metallicFactor = 0;
  model.materials.push_back(material);
  primitive.material = 0;
  tinygltf::Mesh mesh;
  mesh.primitives.push_back(primitive);
  model.meshes.push_back(mesh);
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
  const std::uint64_t bytes = scan.positions.size() * 44 + scan.triangles.size() * sizeof(Triangle);
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
