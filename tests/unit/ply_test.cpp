#include "io/ply.h"

#include <clocale>

#include <sstream>

#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

const std::string kAscii =
    "ply\nformat ascii 1.0\ncomment by hand\nobj_info none\nelement vertex 4\nproperty float x\nproperty "
    "float y\n"
    "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n3 0 1 2\n4 0 1 2 3\n";

std::string binary_header(const std::string& order, const std::string& elements) {
  return "ply\nformat binary_" + order + "_endian 1.0\n" + elements + "end_header\n";
}

TEST(Ply, AsciiPolygonsBecomeFans) {
  const RawScan scan = parse_scan(kAscii, "a.ply");
  ASSERT_EQ(scan.positions.size(), 4u);
  EXPECT_EQ(scan.positions[3], (Vec3d{0, 1, 0.5}));
  const std::vector<Triangle> expected = {{0, 1, 2}, {0, 1, 2}, {0, 2, 3}};
  EXPECT_EQ(scan.triangles, expected);
  EXPECT_TRUE(scan.object_ids.empty());
  EXPECT_TRUE(scan.notes.empty());
}

TEST(Ply, AnyTypeAndOrderInBothEndians) {
  const std::string elements =
      "element face 1\nproperty uchar quality\nproperty list ushort uint vertex_index\nproperty short "
      "object_id\n"
      "element other 2\nproperty list uchar double values\n"
      "element vertex 3\nproperty uchar red\nproperty double z\nproperty short x\nproperty ushort "
      "y\nproperty char w\n"
      "property uchar green\nproperty uchar blue\nproperty list uchar float ignored\nproperty int big\n";
  const auto body = [](auto put) {
    std::string bytes;
    bytes += put(std::uint8_t{9}) + put(std::uint16_t{3}) + put(std::uint32_t{0}) + put(std::uint32_t{2}) +
             put(std::uint32_t{1}) + put(std::int16_t{-7});
    bytes += put(std::uint8_t{2}) + put(1.0) + put(2.0) + put(std::uint8_t{0});
    for (int i = 0; i < 3; ++i)
      bytes += put(static_cast<std::uint8_t>(10 + i)) + put(0.1 * i) +
               put(static_cast<std::int16_t>(-100 * i)) + put(static_cast<std::uint16_t>(60000 + i)) +
               put(static_cast<std::int8_t>(-i)) + put(std::uint8_t{20}) + put(std::uint8_t{30}) +
               put(std::uint8_t{1}) + put(1.5f) + put(std::int32_t{100000 + i});
    return bytes;
  };
  const std::string little = binary_header("little", elements) + body([](auto value) { return raw(value); });
  const std::string big =
      binary_header("big", elements) + body([](auto value) { return raw_big_endian(value); });
  for (const std::string& bytes : {little, big}) {
    const RawScan scan = parse_scan(bytes, "a.ply");
    ASSERT_EQ(scan.positions.size(), 3u);
    EXPECT_EQ(scan.positions[2], (Vec3d{-200, 60002, 0.2}));
    EXPECT_EQ(scan.colors[1], (Color8{11, 20, 30}));
    ASSERT_EQ(scan.properties.size(), 2u);
    EXPECT_EQ(scan.properties[0].name, "w");
    EXPECT_EQ(scan.properties[0].values[2], -2.0f);
    EXPECT_EQ(scan.properties[1].values[1], 100001.0f);
    EXPECT_EQ(scan.triangles, (std::vector<Triangle>{{0, 2, 1}}));
    EXPECT_EQ(scan.object_ids, (std::vector<std::int32_t>{-7}));
    EXPECT_EQ(scan.notes.size(), 3u);  // quality, other, ignored
  }
}

TEST(Ply, DoublesAreKept) {
  const std::string bytes =
      binary_header("little", "element vertex 1\nproperty double x\nproperty double y\nproperty double z\n") +
      raw(512345.678901) + raw(5403210.123456) + raw(-0.000001);
  EXPECT_EQ(parse_scan(bytes, "a.ply").positions[0], (Vec3d{512345.678901, 5403210.123456, -0.000001}));
}

TEST(Ply, TriangleStripsTurnRight) {
  const std::string bytes =
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n9 0 1 2 3 -1 2 3 4 -1\n";
  const std::vector<Triangle> expected = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}};
  EXPECT_EQ(parse_scan(bytes, "a.ply").triangles, expected);
}

TEST(Ply, CrLfAndOldMacLineEnds) {
  for (const std::string end : {"\r\n", "\r"}) {
    std::string bytes;
    for (const char c : kAscii) bytes += c == '\n' ? end : std::string(1, c);
    EXPECT_EQ(parse_scan(bytes, "a.ply").triangles.size(), 3u);
  }
  std::string header =
      binary_header("little", "element vertex 1\nproperty uchar x\nproperty uchar y\nproperty uchar z\n");
  std::string with_cr;
  for (const char c : header) with_cr += c == '\n' ? std::string("\r\n") : std::string(1, c);
  // The first value is a line feed: it belongs to the data.
  EXPECT_EQ(parse_scan(with_cr + "\x0a\x0d\x0a", "a.ply").positions[0], (Vec3d{10, 13, 10}));
  EXPECT_EQ(parse_scan(header + "\x0a\x0d\x0a", "a.ply").positions[0], (Vec3d{10, 13, 10}));
}

TEST(Ply, NumbersAsProgramsWriteThem) {
  const std::string bytes =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n"
      "+1.5 -2e-3 1E+2\nnan inf -inf\n1.#QNAN 1e-400 -1e400\n";
  const RawScan scan = parse_scan(bytes, "a.ply");
  EXPECT_EQ(scan.positions[0], (Vec3d{1.5, -2e-3, 100}));
  EXPECT_TRUE(std::isnan(scan.positions[1].x));
  EXPECT_TRUE(std::isinf(scan.positions[1].y));
  EXPECT_TRUE(std::isnan(scan.positions[2].x));
  EXPECT_EQ(scan.positions[2].y, 0);
  EXPECT_EQ(scan.positions[2].z, -std::numeric_limits<double>::infinity());
}

TEST(Ply, ColorsOfOtherTypes) {
  const auto with = [](const std::string& type, const std::string& values) {
    return parse_scan(
               "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
               "z\nproperty " +
                   type + " red\nproperty " + type + " green\nproperty " + type +
                   " blue\nend_header\n0 0 0 " + values + "\n",
               "a.ply")
        .colors.at(0);
  };
  EXPECT_EQ(with("uchar", "1 2 255"), (Color8{1, 2, 255}));
  EXPECT_EQ(with("float", "0 0.5 1"), (Color8{0, 128, 255}));
  EXPECT_EQ(with("ushort", "0 32768 65535"), (Color8{0, 128, 255}));
}

TEST(Ply, NamesInAnyCaseAndSpelling) {
  for (const char* names :
       {"X Y Z Red Green Blue NX NY NZ", "x y z R G B NormalX NormalY NormalZ",
        "x y z DIFFUSE_RED Diffuse_Green diffuse_blue Nx Ny Nz", "X Y Z r g b Normal_X Normal_Y Normal_Z"}) {
    std::string header = "ply\nformat ascii 1.0\nelement Vertex 2\n";
    std::istringstream words(names);
    for (std::string word; words >> word;) header += "property float " + word + "\n";
    header += "property uchar Alpha\nend_header\n";
    for (const char* mark : {"", "\xef\xbb\xbf"}) {
      const RawScan scan =
          parse_scan(mark + header + "0 0 0 200 100 50 0 0 1 255\n1 0 0 1 2 3 0 1 0 255\n\x1a", "a.ply");
      EXPECT_EQ(scan.positions[1], (Vec3d{1, 0, 0})) << names;
      EXPECT_EQ(scan.colors, (std::vector<Color8>{{200, 100, 50}, {1, 2, 3}})) << names;
      EXPECT_EQ(scan.normals[1], (Vec3f{0, 1, 0})) << names;
      EXPECT_EQ(scan.properties.size(), 1u) << names;
    }
  }
}

TEST(Ply, CutAnywhereIsAnError) {
  check_prefixes(kAscii, "a.ply", kAscii.size() - 1);
  const std::string binary =
      binary_header("little",
                    "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
                    "property list uchar int vertex_indices\n") +
      raw(0.0f) + raw(0.0f) + raw(0.0f) + raw(1.0f) + raw(0.0f) + raw(0.0f) + raw(0.0f) + raw(1.0f) +
      raw(0.0f) + raw(std::uint8_t{3}) + raw(0) + raw(1) + raw(2);
  EXPECT_EQ(parse_scan(binary, "a.ply").triangles.size(), 1u);
  check_prefixes(binary, "a.ply", binary.size());
}

TEST(Ply, ErrorsSayWhere) {
  std::string bytes = kAscii;
  bytes.replace(bytes.find("3 0 1 2"), 7, "3 0 1 4");
  EXPECT_NE(input_error(bytes, "a.ply").find("line 16: the vertex index 4 is out of range"),
            std::string::npos);
  bytes = kAscii;
  bytes.replace(bytes.find("1 1 0"), 5, "1 x 0");
  EXPECT_NE(input_error(bytes, "a.ply").find("line 14: 'x' is not a number in vertex 2 of 4"),
            std::string::npos);
}

TEST(Ply, WriteAndReadAgain) {
  Scan mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  mesh.colors = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  mesh.properties = {{"red", {1, 2, 3}}, {"gps time", {4, 5, 6}}, {"gps_time", {7, 8, 9}}};
  mesh.triangles = {{0, 1, 2}};
  mesh.object_ids = {5};
  mesh.shift = {512600, 5403580.1, -1.0 / 3};
  mesh.units = "mm";
  const std::string bytes = encoded(mesh);
  const RawScan read = parse_scan(bytes, "a.ply");
  EXPECT_EQ(static_cast<Vec3f>(read.positions[1]), mesh.positions[1]);
  EXPECT_EQ(read.normals, mesh.normals);
  EXPECT_EQ(read.colors, mesh.colors);
  EXPECT_EQ(read.triangles, mesh.triangles);
  EXPECT_EQ(read.object_ids, mesh.object_ids);
  EXPECT_EQ(read.shift, mesh.shift);
  EXPECT_EQ(read.units, "mm");
  ASSERT_EQ(read.properties.size(), 3u);
  EXPECT_EQ(read.properties[0].name, "red_2");
  EXPECT_EQ(read.properties[1].name, "gps_time");
  EXPECT_EQ(read.properties[2].name, "gps_time_2");
  EXPECT_EQ(read.properties[2].values, mesh.properties[2].values);

  Scan cloud;
  cloud.positions = {{1, 2, 3}, {4, 5, 6}};
  cloud.normals = {{0, 0, 1}, {1, 0, 0}};
  cloud.radii = {0.5f, 0.25f};
  cloud.object_ids = {0, 3};
  const RawScan again = parse_scan(encoded(cloud), "a.ply");
  EXPECT_TRUE(again.triangles.empty());
  EXPECT_EQ(again.radii, cloud.radii);
  EXPECT_EQ(again.object_ids, cloud.object_ids);
}

// The layout that scripts rely on.
TEST(Ply, HeaderOfAnOutput) {
  Scan mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.colors.resize(3);
  mesh.properties = {{"quality", {1, 2, 3}}};
  mesh.triangles = {{0, 1, 2}};
  const std::string bytes = encoded(mesh);
  EXPECT_EQ(
      bytes.substr(0, bytes.find("end_header")),
      "ply\nformat binary_little_endian 1.0\ncomment written by rbvh\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property float quality\nelement face 1\nproperty list uchar int vertex_indices\nproperty int "
      "object_id\n");
  EXPECT_EQ(bytes.size() - bytes.find("end_header") - 11, 3 * (12 + 3 + 4) + 1 + 12 + 4u);
}

}  // namespace
}  // namespace rbvh
