#include "io/gltf.h"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <utility>

#include "io/colors.h"
#include "io/gltf_draco.h"
#include "io/gltf_file.h"
#include "io/gltf_textures.h"
#include "io/text_cursor.h"
#include "pipeline/base/affine.h"
#include "pipeline/base/error.h"
#include "pipeline/base/srgb.h"
#include "pipeline/base/text.h"
#include "pipeline/base/units.h"

namespace rbvh {
namespace {

using nlohmann::json;

enum Mode : std::size_t { kPoints = 0, kLineStrip = 3, kTriangles = 4, kStrip = 5, kFan = 6 };

// Instances multiply what a file holds: this many vertices and triangles for each of its bytes.
constexpr std::size_t kMostPerByte = 64, kAlways = 1 << 20;

Affine rotation_of(const float* q) {
  double x = q[0], y = q[1], z = q[2], w = q[3];
  const double size = std::sqrt(x * x + y * y + z * z + w * w);
  if (!(size > 0)) return {};
  x /= size, y /= size, z /= size, w /= size;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0,  //
           2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0,  //
           2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0}};
}

Affine placed(const Vec3d& translation, const Affine& rotation, const Vec3d& scale) {
  Affine a = rotation;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      a.m[4 * row + column] *= scale[static_cast<int>(column)];
    a.m[4 * row + 3] = translation[static_cast<int>(row)];
  }
  return a;
}

Vec3d vector_of(const json& object, const char* key, const Vec3d& otherwise) {
  if (!object.contains(key)) return otherwise;
  const auto v = object[key].get<std::array<double, 3>>();
  return {v[0], v[1], v[2]};
}

Affine transform_of(const json& node) {
  if (node.contains("matrix")) {  // column by column
    const auto m = node["matrix"].get<std::array<double, 16>>();
    return {{m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10], m[14]}};
  }
  std::array<float, 4> rotation = {0, 0, 0, 1};
  if (node.contains("rotation")) rotation = node["rotation"].get<std::array<float, 4>>();
  return placed(vector_of(node, "translation", {}), rotation_of(rotation.data()),
                vector_of(node, "scale", {1, 1, 1}));
}

/// A primitive's arrays, in its own space.
struct Primitive {
  GltfValues positions, normals, colors, radii, places;
  std::vector<std::uint32_t> indices;
  std::optional<GltfTextureUse> texture;  ///< with `places` in it
};

/// What all instances come to.
struct Collected {
  std::vector<Vec3d> positions;
  std::vector<Vec3f> normals;
  std::vector<Color8> colors;
  std::vector<float> radii;
  std::vector<Triangle> triangles;
  std::vector<std::int32_t> object_ids;
  std::vector<FaceTexture> face_textures;  ///< of the triangles so far, or fewer
};

class GltfReader {
 public:
  GltfReader(std::string_view bytes, const std::string& file)
      : gltf_(bytes, file), textures_(gltf_), most_(std::max(kAlways, kMostPerByte * bytes.size())) {}

  RawScan read() {
    const json& asset = gltf_.root().at("asset");
    is_own_ = asset.value("generator", json()) == "rbvh";
    for (const std::size_t node : roots()) visit(node);
    const json& root = gltf_.root();
    if ((!root.contains("nodes") || root["nodes"].empty()) && root.contains("meshes"))
      for (std::size_t mesh = 0; mesh < root["meshes"].size(); ++mesh) add_mesh(mesh, {});
    return finish(asset);
  }

 private:
  /// Of the default scene, else of all nodes that are nobody's children.
  std::vector<std::size_t> roots() const {
    const json& root = gltf_.root();
    std::vector<std::size_t> list;
    if (root.contains("scenes") && !root["scenes"].empty()) {
      const json& scene = gltf_.element("scenes", gltf_number(root, "scene", 0));
      if (scene.contains("nodes"))
        for (const json& node : scene["nodes"]) list.push_back(node.get<std::size_t>());
      return list;
    }
    if (!root.contains("nodes")) return list;
    std::set<std::size_t> children;
    for (const json& node : root["nodes"])
      if (node.contains("children"))
        for (const json& child : node["children"]) children.insert(child.get<std::size_t>());
    for (std::size_t i = 0; i < root["nodes"].size(); ++i)
      if (!children.contains(i)) list.push_back(i);
    return list;
  }

  void visit(std::size_t first) {
    std::vector<std::pair<std::size_t, Affine>> waiting = {{first, {}}};
    while (!waiting.empty()) {
      const auto [index, above] = waiting.back();
      waiting.pop_back();
      if (!visited_.insert(index).second) gltf_.fail("node " + std::to_string(index) + " has two parents");
      const json& node = gltf_.element("nodes", index);
      const Affine to_world = is_own_ ? Affine{} : above * transform_of(node);
      if (!to_world.is_finite())
        gltf_.fail("node " + std::to_string(index) + " is not placed by finite numbers");
      if (node.contains("mesh")) {
        skins_ += node.contains("skin");
        for (const Affine& instance : instances_of(node))
          add_mesh(gltf_number(node, "mesh"), to_world * instance);
      }
      if (node.contains("children"))
        for (auto child = node["children"].rbegin(); child != node["children"].rend(); ++child)
          waiting.emplace_back(child->get<std::size_t>(), to_world);
    }
  }

  /// EXT_mesh_gpu_instancing.
  std::vector<Affine> instances_of(const json& node) {
    const auto extensions = node.find("extensions");
    if (extensions == node.end() || !extensions->contains("EXT_mesh_gpu_instancing")) return {Affine{}};
    const json& attributes = (*extensions)["EXT_mesh_gpu_instancing"].at("attributes");
    std::size_t count = SIZE_MAX;
    const auto values_of = [&](const char* name, std::size_t columns) {
      GltfValues values;
      if (!attributes.contains(name)) return values;
      values = gltf_.values(gltf_number(attributes, name));
      if (values.columns != columns) gltf_.fail("instances have an attribute of another type");
      count = std::min(count, values.rows);
      return values;
    };
    const GltfValues translations = values_of("TRANSLATION", 3), rotations = values_of("ROTATION", 4),
                     scales = values_of("SCALE", 3);
    const auto vector_at = [](const GltfValues& values, std::size_t i, const Vec3d& otherwise) {
      if (values.rows == 0) return otherwise;
      const float* v = &values.values[3 * i];
      return Vec3d{static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
    };
    std::vector<Affine> instances;
    for (std::size_t i = 0; count != SIZE_MAX && i < count; ++i)
      instances.push_back(placed(vector_at(translations, i, {}),
                                 rotations.rows ? rotation_of(&rotations.values[4 * i]) : Affine{},
                                 vector_at(scales, i, {1, 1, 1})));
    return instances;
  }

  void add_mesh(std::size_t index, const Affine& to_world) {
    for (const json& primitive : gltf_.element("meshes", index).at("primitives")) {
      morphs_ += primitive.contains("targets") && !primitive["targets"].empty();
      const std::size_t mode = gltf_number(primitive, "mode", kTriangles);
      if (mode > kFan) gltf_.fail("mesh " + std::to_string(index) + " has a primitive of an unknown mode");
      if (mode != kPoints && mode <= kLineStrip)
        ++lines_;
      else
        add(read_primitive(primitive, index), primitive, mode, to_world);
    }
    ++objects_;
  }

  Primitive read_primitive(const json& described, std::size_t mesh) {
    Primitive p;
    const json& attributes = described.at("attributes");
    DracoMesh packed;
    const auto extensions = described.find("extensions");
    if (extensions != described.end() && extensions->contains("KHR_draco_mesh_compression")) {
      const json& draco = (*extensions)["KHR_draco_mesh_compression"];
      packed = decode_draco(gltf_.view(gltf_number(draco, "bufferView")),
                            draco.at("attributes").get<std::map<std::string, std::uint32_t>>());
      if (packed.indices.empty() && !attributes_are_there(attributes))
        gltf_.fail("mesh " + std::to_string(mesh) +
                   " is compressed by Draco, and damaged or not supported here");
    }
    const auto fetch = [&](const char* name, std::size_t least, std::size_t most) {
      GltfValues values;
      if (const auto found = packed.attributes.find(name); found != packed.attributes.end())
        values = std::move(found->second);
      else if (attributes.contains(name))
        values = gltf_.values(gltf_number(attributes, name));
      if (values.rows > 0 && (values.columns < least || values.columns > most))
        gltf_.fail("mesh " + std::to_string(mesh) + " has a " + name + " of another type");
      if (values.rows > 0 && p.positions.rows > 0 && values.rows != p.positions.rows)
        gltf_.fail("mesh " + std::to_string(mesh) + " has attributes of different lengths");
      return values;
    };
    p.positions = fetch("POSITION", 3, 3);
    p.normals = fetch("NORMAL", 3, 3);
    p.colors = fetch("COLOR_0", 3, 4);
    p.radii = fetch("_RADIUS", 1, 1);
    if (described.contains("material")) p.texture = textures_.of_material(gltf_number(described, "material"));
    if (p.texture) {
      try {
        p.places = fetch(p.texture->coordinates.c_str(), 2, 2);
      } catch (const Error&) {  // as good as none
      }
      if (p.places.rows == 0) ++unplaced_;
      if (p.places.rows == 0) p.texture = {};
    }
    if (!packed.indices.empty())
      p.indices = std::move(packed.indices);
    else if (described.contains("indices"))
      p.indices = gltf_.indices(gltf_number(described, "indices"));
    else
      for (std::size_t i = 0; i < p.positions.rows; ++i) p.indices.push_back(static_cast<std::uint32_t>(i));
    for (const std::uint32_t index : p.indices)
      if (index >= p.positions.rows)
        gltf_.fail("mesh " + std::to_string(mesh) + " has the index " + std::to_string(index) + ", and " +
                   std::to_string(p.positions.rows) + " vertices");
    return p;
  }

  /// Uncompressed beside the compressed ones, for programs that do not know these.
  bool attributes_are_there(const json& attributes) const {
    return attributes.contains("POSITION") &&
           gltf_.element("accessors", gltf_number(attributes, "POSITION")).contains("bufferView");
  }

  void add(const Primitive& p, const json& described, std::size_t mode, const Affine& to_world) {
    Collected& all = mode == kPoints ? points_ : meshes_;
    const std::size_t first = all.positions.size(), count = p.positions.rows;
    if (first + count > most_ || all.triangles.size() + p.indices.size() > most_)
      gltf_.fail("its instances come to more than " + std::to_string(most_) + " vertices or triangles");
    append_vertices(p, described, to_world, all);
    if (mode == kPoints) {
      all.object_ids.resize(all.positions.size(), objects_);
      return;
    }
    const bool mirrored = to_world.determinant() < 0;
    const auto add_triangle = [&](std::size_t a, std::size_t b, std::size_t c) {
      if (mirrored) std::swap(b, c);
      const auto corner = [&](std::size_t i) { return static_cast<std::uint32_t>(first + p.indices[i]); };
      all.triangles.push_back({corner(a), corner(b), corner(c)});
      if (!p.texture) return;
      all.face_textures.resize(all.triangles.size() - 1);
      all.face_textures.push_back(
          {p.texture->texture, {place(p, p.indices[a]), place(p, p.indices[b]), place(p, p.indices[c])}});
    };
    const std::size_t corners = p.indices.size();
    for (std::size_t i = 0; i + 2 < corners; i += mode == kTriangles ? 3 : 1) {
      if (mode == kFan)
        add_triangle(0, i + 1, i + 2);
      else if (mode == kStrip && i % 2 == 1)
        add_triangle(i + 1, i, i + 2);
      else
        add_triangle(i, i + 1, i + 2);
    }
    cut_ += mode == kTriangles ? corners % 3 != 0 : corners < 3;
    all.object_ids.resize(all.triangles.size(), objects_);
  }

  static std::array<float, 2> place(const Primitive& p, std::uint32_t vertex) {
    const float* uv = &p.places.values[2 * std::size_t{vertex}];
    const auto along = [&](const std::array<float, 3>& row) {
      return row[0] * uv[0] + row[1] * uv[1] + row[2];
    };
    return {along(p.texture->transform[0]), along(p.texture->transform[1])};
  }

  void append_vertices(const Primitive& p, const json& described, const Affine& to_world, Collected& all) {
    const std::size_t first = all.positions.size(), count = p.positions.rows;
    const auto row = [](const GltfValues& values, std::size_t i) {
      const float* v = &values.values[values.columns * i];
      return Vec3f{v[0], v[1], v[2]};
    };
    for (std::size_t i = 0; i < count; ++i)
      all.positions.push_back(to_world.point(Vec3d(row(p.positions, i))));
    if (p.normals.rows > 0 && to_world.determinant() != 0) {
      const Affine back = inverse(to_world);
      all.normals.resize(first);
      for (std::size_t i = 0; i < count; ++i)
        all.normals.push_back(normalized(Vec3f(back.transposed(Vec3d(row(p.normals, i))))));
    }
    const Vec3f factor = base_color(described);
    if (p.colors.rows > 0 || factor != Vec3f{1, 1, 1}) {
      all.colors.resize(first, Color8{255, 255, 255});
      for (std::size_t i = 0; i < count; ++i) {
        const Vec3f c = p.colors.rows > 0 ? row(p.colors, i) : Vec3f{1, 1, 1};
        const auto byte = [](float linear) { return to_color_byte(255 * linear_to_srgb(linear)); };
        all.colors.push_back({byte(c.x * factor.x), byte(c.y * factor.y), byte(c.z * factor.z)});
      }
    }
    if (p.radii.rows > 0) {
      all.radii.resize(first);
      all.radii.insert(all.radii.end(), p.radii.values.begin(), p.radii.values.end());
    }
  }

  /// Of a primitive's material, linear.
  Vec3f base_color(const json& described) {
    if (!described.contains("material")) return {1, 1, 1};
    const std::size_t index = gltf_number(described, "material");
    const json& material = gltf_.element("materials", index);
    if (!material.contains("pbrMetallicRoughness")) return {1, 1, 1};
    const json& looks = material["pbrMetallicRoughness"];
    if (!looks.contains("baseColorFactor")) return {1, 1, 1};
    const auto factor = looks["baseColorFactor"].get<std::array<float, 4>>();
    return {factor[0], factor[1], factor[2]};
  }

  RawScan finish(const json& asset) {
    RawScan scan;
    const auto note = [&](std::size_t count, const std::string& one, const std::string& what) {
      if (count > 0) scan.notes.push_back(std::to_string(count) + " " + one + (count == 1 ? "" : "s") + what);
    };
    Collected& all = meshes_.triangles.empty() ? points_ : meshes_;
    if (!meshes_.triangles.empty())
      note(points_.positions.size(), "point", " beside the triangles were left out");
    note(lines_, "primitive", " of lines were left out");
    note(cut_, "primitive", " with corners that make no triangle were cut");
    note(skins_, "skinned mesh", ", read as stored, not as posed");
    note(morphs_, "primitive", " with morph targets, which are not applied");
    note(unplaced_, "primitive", " of materials with a texture without texture coordinates");
    if (!textures_.faults.empty())
      scan.texture_faults.push_back(counted(textures_.faults.size(), "material") +
                                    " without its texture: " + textures_.faults.begin()->second);
    scan.face_textures = std::move(all.face_textures);
    if (!scan.face_textures.empty()) {
      scan.face_textures.resize(all.triangles.size());
      scan.textures = std::move(textures_.textures);
    }
    const std::size_t count = all.positions.size();
    if (!all.normals.empty()) all.normals.resize(count);
    if (!all.colors.empty()) all.colors.resize(count, Color8{255, 255, 255});
    if (!all.radii.empty() && all.triangles.empty()) {
      all.radii.resize(count);
      scan.radii = std::move(all.radii);
    }
    if (std::adjacent_find(all.object_ids.begin(), all.object_ids.end(), std::not_equal_to<>()) ==
        all.object_ids.end())
      all.object_ids.clear();
    scan.positions = std::move(all.positions);
    scan.normals = std::move(all.normals);
    scan.colors = std::move(all.colors);
    scan.triangles = std::move(all.triangles);
    scan.object_ids = std::move(all.object_ids);
    if (is_own_ && asset.contains("extras")) scan.shift = vector_of(asset["extras"], "rbvh_shift", {});
    if (is_own_ && asset.contains("extras")) {
      const auto units = asset["extras"].value("rbvh_units", std::string());
      if (unit_meters(units)) scan.units = units;
    }
    if (!is_finite(scan.shift)) gltf_.fail("its shift is not finite");
    return scan;
  }

  GltfFile gltf_;
  GltfTextures textures_;
  std::size_t most_;
  bool is_own_ = false;
  Collected meshes_, points_;
  std::set<std::size_t> visited_;
  std::int32_t objects_ = 0;
  std::size_t lines_ = 0, skins_ = 0, morphs_ = 0, cut_ = 0, unplaced_ = 0;
};

}  // namespace

bool is_gltf(std::string_view bytes) {
  if (bytes.starts_with("glTF")) return true;
  const std::size_t first = bytes.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && bytes[first] == '{' &&
         bytes.find("\"asset\"") != std::string_view::npos;
}

RawScan read_gltf(std::string_view bytes, const std::string& file) {
  try {
    return GltfReader(bytes, file).read();
  } catch (const json::exception& error) {
    throw Error(ErrorKind::kInput, file,
                "its JSON is not as glTF has it: " + std::string(error.what()).substr(0, 120));
  }
}

}  // namespace rbvh
