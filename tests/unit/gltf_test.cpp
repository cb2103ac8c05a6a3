// glTF: files made by hand, and those that rbvh writes.
#include "io/gltf.h"

#include <meshoptimizer.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "rbvh/io.h"
#include "tests/scan_bytes.h"
#ifdef RBVH_DRACO
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#endif

namespace rbvh {
namespace {

using Json = nlohmann::json;
constexpr int kUint8 = 5121, kInt16 = 5122, kUint16 = 5123, kUint32 = 5125, kFloat = 5126;

/// A file in the making: arrays become accessors.
struct Gltf {
  Json root = {{"asset", {{"version", "2.0"}}}, {"buffers", Json::array()}, {"bufferViews", Json::array()},
               {"accessors", Json::array()},    {"meshes", Json::array()},  {"nodes", Json::array()}};
  std::string binary;

  std::size_t view(const std::string& bytes) {
    binary.resize((binary.size() + 3) / 4 * 4, '\0');
    root["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
    binary += bytes;
    return root["bufferViews"].size() - 1;
  }
  template <class T>
  std::size_t add(const std::vector<T>& values, const char* type, int component, std::size_t columns) {
    std::string bytes;
    for (const T value : values) bytes += raw(value);
    root["accessors"].push_back({{"bufferView", view(bytes)},
                                 {"count", values.size() / columns},
                                 {"type", type},
                                 {"componentType", component}});
    return root["accessors"].size() - 1;
  }
  std::size_t positions(const std::vector<float>& values) { return add(values, "VEC3", kFloat, 3); }
  std::size_t indices(const std::vector<std::uint16_t>& values) { return add(values, "SCALAR", kUint16, 1); }
  void mesh(Json primitive) {
    root["meshes"].push_back(Json{{"primitives", Json::array({std::move(primitive)})}});
  }
  void node(Json node) { root["nodes"].push_back(std::move(node)); }

  std::string glb() {
    root["buffers"] = Json::array({{{"byteLength", binary.size()}}});
    std::string text = root.dump(), bin = binary;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    const auto length = [](const std::string& s) { return raw(static_cast<std::uint32_t>(s.size())); };
    const std::string chunks = length(text) + "JSON" + text + length(bin) + std::string("BIN\0", 4) + bin;
    return "glTF" + raw(std::uint32_t{2}) + raw(static_cast<std::uint32_t>(12 + chunks.size())) + chunks;
  }
  RawScan scan() { return parse_scan(glb(), "a.glb"); }
};

const std::vector<float> kSquare = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};

/// A square of two triangles as mesh 0.
Gltf square() {
  Gltf gltf;
  const std::size_t positions = gltf.positions(kSquare), indices = gltf.indices({0, 1, 2, 0, 2, 3});
  gltf.mesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}});
  return gltf;
}

bool has_note(const RawScan& scan, const std::string& words) {
  return std::any_of(scan.notes.begin(), scan.notes.end(),
                     [&](const std::string& note) { return note.find(words) != std::string::npos; });
}

void expect_near(const Vec3d& a, const Vec3d& b) {
  EXPECT_LT(length(a - b), 1e-6) << a.x << " " << a.y << " " << a.z;
}

TEST(Gltf, TrianglesNormalsAndColours) {
  Gltf gltf = square();
  gltf.node({{"mesh", 0}});
  Json& primitive = gltf.root["meshes"][0]["primitives"][0];
  primitive["attributes"]["NORMAL"] = gltf.positions({0, 0, 2, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  primitive["attributes"]["COLOR_0"] = gltf.add<std::uint16_t>(
      {65535, 0, 0, 1, 65535, 65535, 65535, 1, 13909, 0, 0, 1, 0, 0, 0, 1}, "VEC4", kUint16, 4);
  gltf.root["accessors"].back()["normalized"] = true;
  primitive["material"] = 0;
  gltf.root["materials"] =
      Json::array({{{"pbrMetallicRoughness",
                     {{"baseColorFactor", {1, 0.5, 1, 1}}, {"baseColorTexture", {{"index", 0}}}}}}});
  const RawScan scan = gltf.scan();
  ASSERT_EQ(scan.positions.size(), 4u);
  EXPECT_EQ(scan.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(scan.normals, std::vector<Vec3f>(4, Vec3f{0, 0, 1}));
  // Linear light to sRGB: 0.5 is 188, 0.2122 is 127.
  EXPECT_EQ(scan.colors, (std::vector<Color8>{{255, 0, 0}, {255, 188, 255}, {127, 0, 0}, {0, 0, 0}}));
  EXPECT_EQ(
      scan.texture_faults,
      std::vector<std::string>{"1 material without its texture: there is no element 0 of its textures"});
  EXPECT_TRUE(scan.object_ids.empty());
}

TEST(Gltf, NodesPlaceAndInstancesAreObjects) {
  Gltf gltf = square();
  const double half = std::sqrt(0.5);
  gltf.node({{"children", {1, 2}}, {"translation", {1e6, 0, 0.25}}});
  gltf.node({{"mesh", 0}, {"rotation", {0, 0, half, half}}, {"scale", {2, 3, 1}}});  // a quarter turn about z
  gltf.node({{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1}}});
  gltf.root["scenes"] = Json::array({{{"nodes", {0}}}});
  const RawScan scan = gltf.scan();
  ASSERT_EQ(scan.positions.size(), 8u);
  expect_near(scan.positions[1], {1e6, 2, 0.25});
  expect_near(scan.positions[2], {1e6 - 3, 2, 0.25});
  expect_near(scan.positions[5], {1e6 + 4, 6, 7.25});
  EXPECT_EQ(scan.object_ids, (std::vector<std::int32_t>{0, 0, 1, 1}));
  EXPECT_EQ(scan.triangles[0], (Triangle{0, 1, 2}));
  EXPECT_EQ(scan.triangles[2], (Triangle{4, 6, 5}));  // mirrored: the front stays the front
}

TEST(Gltf, InstancesOfOneNode) {
  Gltf gltf = square();
  const std::size_t at = gltf.positions({0, 0, 0, 5, 0, 0}), scale = gltf.positions({1, 1, 1, 2, 2, 2});
  gltf.node({{"mesh", 0},
             {"extensions",
              {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", at}, {"SCALE", scale}}}}}}}});
  gltf.root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  const RawScan scan = gltf.scan();
  ASSERT_EQ(scan.positions.size(), 8u);
  expect_near(scan.positions[6], {7, 2, 0});
  EXPECT_EQ(scan.object_ids, (std::vector<std::int32_t>{0, 0, 1, 1}));
}

TEST(Gltf, StripsFansPointsAndLines) {
  Gltf gltf;
  const std::size_t positions = gltf.positions(kSquare), order = gltf.indices({0, 1, 3, 2});
  const auto primitive = [&](int mode) {
    Json p = {{"attributes", {{"POSITION", positions}}}, {"mode", mode}};
    if (mode == 5) p["indices"] = order;
    return p;
  };
  gltf.mesh(primitive(5));
  gltf.node({{"mesh", 0}});
  EXPECT_EQ(gltf.scan().triangles, (std::vector<Triangle>{{0, 1, 3}, {3, 1, 2}}));
  gltf.root["meshes"][0]["primitives"] = Json::array({primitive(6)});
  EXPECT_EQ(gltf.scan().triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
  gltf.root["meshes"][0]["primitives"] = {primitive(6), primitive(0), primitive(1)};
  const RawScan both = gltf.scan();
  EXPECT_EQ(both.positions.size(), 4u);
  EXPECT_TRUE(has_note(both, "4 points beside the triangles"));
  EXPECT_TRUE(has_note(both, "1 primitive of lines"));
  gltf.root["meshes"][0]["primitives"] = Json::array({primitive(0)});
  const RawScan cloud = gltf.scan();
  EXPECT_TRUE(cloud.triangles.empty());
  EXPECT_EQ(cloud.positions.size(), 4u);
}

TEST(Gltf, QuantisedInterleavedAndSparse) {
  Gltf gltf;
  // x, y, z as 16 bits and two bytes between them.
  std::string bytes;
  for (const auto& [x, y] : {std::pair{0, 0}, {32767, 0}, {32767, 32767}, {0, -32767}})
    bytes +=
        raw(static_cast<std::int16_t>(x)) + raw(static_cast<std::int16_t>(y)) + raw(std::int16_t{0}) + "??";
  const std::size_t view = gltf.view(bytes);
  gltf.root["bufferViews"][view]["byteStride"] = 8;
  gltf.root["accessors"].push_back({{"bufferView", view},
                                    {"count", 4},
                                    {"type", "VEC3"},
                                    {"componentType", kInt16},
                                    {"normalized", true}});
  const std::size_t index = gltf.view(raw(std::uint8_t{1})),
                    value = gltf.view(raw(std::int16_t{0}) + raw(std::int16_t{0}) + raw(std::int16_t{32767}));
  gltf.root["accessors"][0]["sparse"] = {{"count", 1},
                                         {"indices", {{"bufferView", index}, {"componentType", kUint8}}},
                                         {"values", {{"bufferView", value}}}};
  gltf.mesh({{"attributes", {{"POSITION", 0}}}, {"mode", 6}});
  gltf.node({{"mesh", 0}, {"scale", {10, 10, 10}}});
  gltf.root["extensionsRequired"] = {"KHR_mesh_quantization"};
  const RawScan scan = gltf.scan();
  expect_near(scan.positions[1], {0, 0, 10});
  expect_near(scan.positions[2], {10, 10, 0});
  expect_near(scan.positions[3], {0, -10, 0});
  gltf.root["accessors"][0]["sparse"]["count"] = 2;
  EXPECT_NE(input_error(gltf.glb(), "a.glb").find("sparse"), std::string::npos);
}

TEST(Gltf, CompressedByMeshopt) {
  Gltf gltf;
  std::vector<float> points;
  for (int i = 0; i < 300; ++i)
    points.insert(points.end(), {static_cast<float>(i), static_cast<float>(i % 7), 1});
  std::vector<std::uint32_t> corners;
  for (std::uint32_t i = 0; i < 298; ++i) corners.insert(corners.end(), {i, i + 1, i + 2});
  std::vector<unsigned char> vertices(meshopt_encodeVertexBufferBound(300, 12));
  vertices.resize(meshopt_encodeVertexBuffer(vertices.data(), vertices.size(), points.data(), 300, 12));
  std::vector<unsigned char> faces(meshopt_encodeIndexBufferBound(corners.size(), 300));
  meshopt_encodeIndexVersion(1);
  faces.resize(meshopt_encodeIndexBuffer(faces.data(), faces.size(), corners.data(), corners.size()));
  const auto packed = [&](const std::vector<unsigned char>& bytes, std::size_t count, std::size_t stride,
                          const char* mode) {
    const std::size_t view = gltf.view(std::string(bytes.begin(), bytes.end()));
    Json& described = gltf.root["bufferViews"][view];
    described["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                          {"byteOffset", described["byteOffset"]},
                                                          {"byteLength", bytes.size()},
                                                          {"byteStride", stride},
                                                          {"count", count},
                                                          {"mode", mode}};
    described["buffer"] = 1;  // which has no bytes
    described["byteOffset"] = 0;
    described["byteLength"] = count * stride;
    return view;
  };
  gltf.root["accessors"] = {{{"bufferView", packed(vertices, 300, 12, "ATTRIBUTES")},
                             {"count", 300},
                             {"type", "VEC3"},
                             {"componentType", kFloat}},
                            {{"bufferView", packed(faces, corners.size(), 4, "TRIANGLES")},
                             {"count", corners.size()},
                             {"type", "SCALAR"},
                             {"componentType", kUint32}}};
  gltf.mesh({{"attributes", {{"POSITION", 0}}}, {"indices", 1}});
  gltf.node({{"mesh", 0}});
  const RawScan scan = gltf.scan();
  ASSERT_EQ(scan.positions.size(), 300u);
  for (std::size_t i = 0; i < 300; ++i)
    EXPECT_EQ(scan.positions[i], (Vec3d{static_cast<double>(i), static_cast<double>(i % 7), 1}));
  EXPECT_EQ(scan.triangles.size(), 298u);
  gltf.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] = 4000000000u;
  EXPECT_NE(input_error(gltf.glb(), "a.glb").find("impossible counts"), std::string::npos);
}

#ifdef RBVH_DRACO
TEST(Gltf, CompressedByDraco) {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(2);
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const float p[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  builder.SetAttributeValuesForFace(id, draco::FaceIndex(0), p[0], p[1], p[2]);
  builder.SetAttributeValuesForFace(id, draco::FaceIndex(1), p[0], p[2], p[3]);
  const auto mesh = builder.Finalize();
  draco::EncoderBuffer buffer;
  ASSERT_TRUE(draco::Encoder().EncodeMeshToBuffer(*mesh, &buffer).ok());
  Gltf gltf;
  const std::size_t view = gltf.view(std::string(buffer.data(), buffer.size()));
  gltf.root["accessors"] = {{{"count", 4}, {"type", "VEC3"}, {"componentType", kFloat}},
                            {{"count", 6}, {"type", "SCALAR"}, {"componentType", kUint32}}};
  const auto unique = mesh->GetNamedAttribute(draco::GeometryAttribute::POSITION)->unique_id();
  gltf.mesh(
      {{"attributes", {{"POSITION", 0}}},
       {"indices", 1},
       {"extensions",
        {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", {{"POSITION", unique}}}}}}}});
  gltf.node({{"mesh", 0}});
  gltf.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  const RawScan scan = gltf.scan();
  EXPECT_EQ(scan.triangles.size(), 2u);
  EXPECT_EQ(scan.positions.size(), 4u);
  gltf.binary[gltf.binary.size() / 2] ^= '\x55';
  gltf.binary.resize(gltf.binary.size() / 2);
  gltf.root["bufferViews"][view]["byteLength"] = gltf.binary.size();
  EXPECT_NE(input_error(gltf.glb(), "a.glb").find("Draco"), std::string::npos);
}
#endif

TEST(Gltf, WhatRbvhWroteComesBack) {
  std::string pattern = (std::filesystem::temp_directory_path() / "rbvh gltf XXXXXX").string();
  ASSERT_NE(mkdtemp(pattern.data()), nullptr);
  Scan scan;
  scan.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  scan.triangles = {{0, 1, 2}};
  scan.normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
  scan.colors = {{255, 0, 128}, {200, 220, 240}, {0, 0, 0}};
  scan.shift = {500000, 5400000, 0};
  const std::string path = pattern + "/a.glb";
  for (const Vec3d up : {Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    write_glb(path, scan, up, true);
    const RawScan back = read_scan(path);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(back.positions[i], Vec3d(scan.positions[i]));
    EXPECT_EQ(back.shift, scan.shift);
    EXPECT_EQ(back.normals, scan.normals);
    EXPECT_EQ(back.triangles, scan.triangles);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(back.colors[i][c], scan.colors[i][c], 2);
  }
  std::filesystem::remove_all(pattern);
}

TEST(Gltf, BuffersInsideAndBeside) {
  std::string pattern = (std::filesystem::temp_directory_path() / "rbvh gltf XXXXXX").string();
  ASSERT_NE(mkdtemp(pattern.data()), nullptr);
  Gltf gltf;
  gltf.mesh({{"attributes", {{"POSITION", gltf.positions({0, 0, 0, 1, 0, 0, 0, 1, 0})}}}});
  gltf.root["buffers"] = Json::array(
      {{{"byteLength", 36},
        {"uri", "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}});
  const RawScan inside = parse_scan("  " + gltf.root.dump(), "a");
  EXPECT_EQ(inside.positions[2], (Vec3d{0, 1, 0}));
  EXPECT_EQ(inside.triangles.size(), 1u);
  gltf.root["buffers"][0]["uri"] = "the%20data.bin";
  std::ofstream(pattern + "/a.gltf") << gltf.root.dump();
  EXPECT_THROW(read_scan(pattern + "/a.gltf"), Error);
  std::ofstream(pattern + "/the data.bin", std::ios::binary) << gltf.binary;
  EXPECT_EQ(read_scan(pattern + "/a.gltf").positions, inside.positions);
  for (const char* outside : {"/etc/passwd", "../a.bin", "file:///a.bin", "http://a/b.bin"}) {
    gltf.root["buffers"][0]["uri"] = outside;
    EXPECT_NE(input_error(gltf.root.dump(), "a.gltf").find("outside its folder"), std::string::npos)
        << outside;
  }
  std::filesystem::remove_all(pattern);
}

TEST(Gltf, WhatIsWrongIsSaid) {
  const auto says = [](Gltf gltf, const char* words) {
    EXPECT_NE(input_error(gltf.glb(), "a.glb").find(words), std::string::npos) << words;
  };
  Gltf gltf = square();
  gltf.node({{"mesh", 0}, {"children", {1}}});
  gltf.node({{"children", {0}}});
  gltf.root["scenes"] = Json::array({{{"nodes", {0}}}});
  says(gltf, "two parents");
  gltf = square();
  gltf.node({{"mesh", 3}});
  says(gltf, "no element 3 of its meshes");
  gltf = square();
  gltf.node({{"mesh", 0}});
  gltf.root["meshes"][0]["primitives"][0]["indices"] = gltf.indices({0, 1, 9});
  says(gltf, "the index 9, and 4 vertices");
  gltf.root["meshes"][0]["primitives"][0]["indices"] = "many";
  says(gltf, "JSON");
  gltf = square();
  gltf.node({{"mesh", 0}});
  gltf.root["accessors"][0]["count"] = 4000000000u;
  says(gltf, "lies outside its buffer view");
  gltf.root["accessors"][0].erase("bufferView");
  says(gltf, "more values than the file has bytes");
  gltf = square();
  gltf.root["extensionsRequired"] = {"ACME_shape"};
  says(gltf, "ACME_shape");
  gltf.root["asset"]["version"] = "1.0";
  says(gltf, "2.0 is read");
  gltf = {};
  says(gltf, "no vertices");
}

TEST(Gltf, InstancesAreBounded) {
  Gltf gltf;
  gltf.mesh({{"attributes", {{"POSITION", gltf.positions(std::vector<float>(3 * 1200, 1.0f))}}}});
  for (int i = 0; i < 3000; ++i) gltf.node({{"mesh", 0}});
  EXPECT_NE(input_error(gltf.glb(), "a.glb").find("instances come to more than"), std::string::npos);
}

TEST(Gltf, CutAnywhere) {
  Gltf gltf = square();
  gltf.node({{"mesh", 0}});
  const std::string bytes = gltf.glb();
  check_prefixes(bytes, "a.glb", bytes.size());
}

}  // namespace
}  // namespace rbvh
