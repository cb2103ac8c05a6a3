// Choosing the reader, merging, large coordinates, other locales.
#include "io/scan_io.h"

#include <clocale>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <locale>

#include "pipeline/scan/ingest.h"
#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

const std::string kPly =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1.5 0 0\n0 1 0\n3 0 1 2\n";

TEST(ReadScan, ContentGoesBeforeTheName) {
  for (const char* name : {"a.ply", "a.obj", "a.stl", "a.xyz", "a", "-"})
    EXPECT_EQ(parse_scan(kPly, name).triangles.size(), 1u) << name;
  EXPECT_EQ(parse_scan("OFF\n1 0 0\n1 2 3\n", "a.ply").positions.size(), 1u);
  EXPECT_EQ(parse_scan("v 0 0 0\nv 1 0 0\n", "-").positions.size(), 2u);
  EXPECT_EQ(parse_scan("0 0 0\n1 0 0\n", "-").positions.size(), 2u);
  EXPECT_EQ(parse_scan("# c\nv 0 0 0\nv 1 0 0\n", "a.OBJ").positions.size(), 2u);
}

TEST(ReadScan, WhatIsNoScanIsRefusedInWords) {
  EXPECT_NE(input_error("hello", "a.dat").find("no known format"), std::string::npos);
  EXPECT_NE(input_error("hello", "a.ply").find("no PLY file"), std::string::npos);
  EXPECT_NE(input_error("LASF....", "a.las").find("cut inside its header"), std::string::npos);
  EXPECT_NE(input_error("\x1f\x8b\x08", "a.ply").find("gzip"), std::string::npos);
}

TEST(ReadScan, ByteOrderMarks) {
  for (const char* text :
       {"0 0 0\n1 0 0\n", "v 0 0 0\nv 1 0 0\n", "OFF\n2 0 0\n0 0 0\n1 0 0\n", "# c\n0 0 0\n1 0 0\n"})
    EXPECT_EQ(parse_scan(std::string("\xef\xbb\xbf") + text, "a").positions.size(), 2u) << text;
  for (const char* name : {"a.xyz", "a.obj", "a.ply", "a.stl", "a.off", "a"})
    for (const bool big : {false, true}) {
      std::string wide = big ? "\xfe\xff" : "\xff\xfe";
      for (const char c : {'0', ' ', '0', ' ', '0', '\n'})
        wide += big ? std::string(1, '\0') + c : c + std::string(1, '\0');
      EXPECT_NE(input_error(wide, name).find("UTF-16"), std::string::npos);
      EXPECT_NE(input_error(wide.substr(2), name).find("UTF-16"), std::string::npos);
    }
}

class Folder : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "rbvh scan io XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    path_ = pattern;
  }
  void TearDown() override { fs::remove_all(path_); }
  std::string file(const std::string& name, const std::string& content) {
    const fs::path path = path_ / name;
    std::ofstream(path, std::ios::binary) << content;
    return path.string();
  }
  fs::path path_;
};

std::string read_error(const std::string& path) {
  try {
    read_scan(path);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << path;
  return "";
}

TEST_F(Folder, FilesFoldersAndNothing) {
  EXPECT_EQ(read_scan(file("with spaces.ply", kPly)).triangles.size(), 1u);
  EXPECT_NE(read_error(file("empty.ply", "")).find("is empty"), std::string::npos);
  EXPECT_NE(read_error(path_.string()).find("is a folder"), std::string::npos);
  EXPECT_NE(read_error((path_ / "missing.ply").string()).find("cannot be opened"), std::string::npos);
}

TEST_F(Folder, WrittenWholeAndNotOverwrittenUnasked) {
  const Scan scan = shift_to_float(parse_scan(kPly, "a.ply"));
  const std::string path = (path_ / "out.ply").string();
  write_ply(path, scan, false);
  EXPECT_EQ(read_scan(path).triangles, scan.triangles);
  EXPECT_THROW(write_ply(path, scan, false), Error);
  write_ply(path, scan, true);
  EXPECT_EQ(std::distance(fs::directory_iterator(path_), fs::directory_iterator()), 1);
}

/// A locale in which one and a half is written 1,5.
class DecimalComma : public std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST(ReadScan, TheLocaleDoesNotMatter) {
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new DecimalComma));
  for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE"})
    if (std::setlocale(LC_ALL, name)) break;
  Scan scan = shift_to_float(parse_scan(kPly, "a.ply"));
  scan.shift = {512345.5, 0, 0};
  const RawScan again = parse_scan(encoded(scan), "a.ply");
  const RawScan text = parse_scan("1.5 2.5 3.5\n", "a.xyz");
  const RawScan obj = parse_scan("v 1.5 2.5 3.5\n", "a.obj");
  const std::string message = input_error(kPly.substr(0, kPly.size() - 4), "a.ply");
  std::setlocale(LC_ALL, "C");
  std::locale::global(before);
  EXPECT_EQ(again.positions[1].x, 1.5);
  EXPECT_EQ(again.shift, (Vec3d{512345.5, 0, 0}));
  EXPECT_EQ(text.positions[0], (Vec3d{1.5, 2.5, 3.5}));
  EXPECT_EQ(obj.positions[0], (Vec3d{1.5, 2.5, 3.5}));
  EXPECT_NE(message.find("face 0 of 1"), std::string::npos);
}

TEST(MergeScan, MeshesGetObjectsOfTheirOwn) {
  RawScan all;
  merge_scan(all, parse_scan(kPly, "a.ply"));
  EXPECT_TRUE(all.object_ids.empty());
  RawScan second = parse_scan(kPly, "a.ply");
  second.object_ids = {-2};
  second.colors.assign(3, Color8{1, 2, 3});
  second.properties = {{"quality", {1, 2, 3}}};
  second.shift = {10, 0, 0};
  merge_scan(all, std::move(second));
  merge_scan(all, parse_scan(kPly, "a.ply"));
  EXPECT_EQ(all.object_ids, (std::vector<std::int32_t>{0, 1, 2}));
  EXPECT_EQ(all.triangles[1], (Triangle{3, 4, 5}));
  EXPECT_EQ(all.positions[3].x, 10);  // its shift is 10, the first one's 0
  EXPECT_EQ(all.colors[0], (Color8{255, 255, 255}));
  EXPECT_EQ(all.colors[4], (Color8{1, 2, 3}));
  ASSERT_EQ(all.properties.size(), 1u);
  EXPECT_TRUE(std::isnan(all.properties[0].values[8]));
  EXPECT_EQ(all.properties[0].values[5], 3.0f);
  EXPECT_THROW(merge_scan(all, parse_scan("1 2 3\n4 5 6\n", "a.xyz")), Error);
}

TEST(MergeScan, UnitsMustAgree) {
  RawScan all, millimetres = parse_scan(kPly, "a.ply");
  millimetres.units = "mm";
  merge_scan(all, RawScan(millimetres));
  merge_scan(all, RawScan(millimetres));
  EXPECT_EQ(all.units, "mm");
  millimetres.units = "in";
  EXPECT_THROW(merge_scan(all, RawScan(millimetres)), Error);
  millimetres.units.clear();
  EXPECT_THROW(merge_scan(all, RawScan(millimetres)), Error);
}

TEST(MergeScan, EachCloudKeepsItsViewpoint) {
  const auto cloud = [](double x) {
    RawScan scan = parse_scan("0 0 0\n1 0 0\n", "a.xyz");
    scan.viewpoints = {{.position = {x, 0, 0}}};
    return scan;
  };
  RawScan all = cloud(1);
  merge_scan(all, cloud(2));
  merge_scan(all, cloud(3));
  ASSERT_EQ(all.viewpoints.size(), 3u);
  for (std::int32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(all.viewpoints[static_cast<std::size_t>(i)].first_object, i);
    EXPECT_EQ(all.viewpoints[static_cast<std::size_t>(i)].last_object, i);
    EXPECT_EQ(all.viewpoints[static_cast<std::size_t>(i)].position.x, i + 1);
  }
}

TEST(ShiftToFloat, OnlyFarCoordinatesMove) {
  RawScan near;
  near.positions = {{15, 0, 0}, {16, 0, 0}};  // diagonal 1, largest 16
  EXPECT_EQ(shift_to_float(RawScan(near)).shift, Vec3d{});
  near.positions = {{15.5, 0, 0}, {16.5, 0, 0}};
  EXPECT_EQ(shift_to_float(RawScan(near)).shift, (Vec3d{16, 0, 0}));
  RawScan small;
  small.positions = {{5.3, 0, 0}, {5.3001, 0, 0}};
  small.viewpoints = {{.position = {5.3, 0, 1}}};
  const Scan moved = shift_to_float(RawScan(small));
  EXPECT_LT(std::abs(moved.positions[0].x), 1e-4f);
  EXPECT_NEAR(static_cast<double>(moved.positions[0].x) + moved.shift.x, 5.3, 1e-11);
  EXPECT_NEAR(moved.viewpoints[0].position.x + moved.shift.x, 5.3, 1e-12);
  RawScan nan;
  nan.positions = {{std::nan(""), 0, 0}};
  EXPECT_EQ(shift_to_float(std::move(nan)).shift, Vec3d{});
}

/// A kilometre of terrain in UTM coordinates, to a tenth of a millimetre.
std::vector<Vec3d> utm_points() {
  std::vector<Vec3d> points;
  for (int i = 0; i < 400; ++i)
    points.push_back(
        {512000.0001 + 47.1234 * (i % 20), 5403000.0002 + 51.4321 * (i / 20), 337.0003 + 0.7531 * (i % 7)});
  return points;
}

TEST(ShiftToFloat, UtmKeepsAMillimetreThroughEveryFormat) {
  const std::vector<Vec3d> points = utm_points();
  std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 400\nproperty double x\nproperty double y\n"
      "property double z\nend_header\n";
  std::string pcd =
      "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 400\nHEIGHT 1\nPOINTS 400\nDATA "
      "binary\n";
  std::string xyz, obj;
  for (const Vec3d& p : points) {
    const std::string bytes = raw(p.x) + raw(p.y) + raw(p.z);
    char line[128];
    std::snprintf(line, sizeof line, "%.4f %.4f %.4f\n", p.x, p.y, p.z);
    ply += bytes;
    pcd += bytes;
    xyz += line;
    obj += std::string("v ") + line;
  }
  for (const auto& [bytes, name] :
       {std::pair{ply, "a.ply"}, {pcd, "a.pcd"}, {xyz, "a.xyz"}, {obj, "a.obj"}}) {
    IngestReport counts;
    const Scan scan = ingest(parse_scan(bytes, name), name, {}, counts);
    const RawScan read = parse_scan(encoded(scan), "out.ply");
    ASSERT_EQ(read.positions.size(), points.size()) << name;
    EXPECT_NE(read.shift.x, 0) << name;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3d off = read.positions[i] + read.shift - points[i];
      EXPECT_LT(std::max({std::abs(off.x), std::abs(off.y), std::abs(off.z)}), 0.001)
          << name << " point " << i;
    }
    // Ingested again, the shift stays what it is.
    IngestReport again;
    EXPECT_EQ(ingest(RawScan(read), name, {}, again).shift, read.shift);
  }
}

}  // namespace
}  // namespace rbvh
