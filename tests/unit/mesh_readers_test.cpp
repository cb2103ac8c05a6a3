// OBJ, STL and OFF.
#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

using Triangles = std::vector<Triangle>;
using Ids = std::vector<std::int32_t>;

TEST(Obj, PolygonsNegativeIndicesAndMissingTextures) {
  const RawScan scan = parse_scan(
      "# comment\nmtllib a.mtl\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
      "f 1/1/1 2//1 3/1/1 4//1 # quad\nf -4 -3 \\\n -2\n",
      "a.obj");
  EXPECT_EQ(scan.positions.size(), 4u);
  EXPECT_EQ(scan.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}}));
  EXPECT_EQ(scan.normals, std::vector<Vec3f>(4, Vec3f{0, 0, 1}));
  EXPECT_TRUE(scan.object_ids.empty());
  EXPECT_EQ(scan.notes.size(), 2u);  // mtllib, vt
}

TEST(Obj, ObjectsAndGroupsAreIds) {
  const RawScan scan = parse_scan(
      "v 0 0 0\nv 1 0 0\nv 0 1 0\no first\nf 1 2 3\no second\ng a\nf 1 2 3\ng b\nf 1 2 3\no first\ng\nf 1 2 "
      "3\n",
      "a.obj");
  EXPECT_EQ(scan.object_ids, (Ids{0, 1, 2, 0}));
}

TEST(Obj, ColorsAndSeveralNormals) {
  const RawScan scan = parse_scan(
      "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 2//1 "
      "3//1\n",
      "a.obj");
  EXPECT_EQ(scan.colors, (std::vector<Color8>{{255, 0, 0}, {0, 255, 0}, {0, 0, 128}}));
  EXPECT_NEAR(scan.normals[0].y, std::sqrt(0.5f), 1e-6f);
  EXPECT_EQ(scan.normals[1], (Vec3f{0, 0, 1}));
  EXPECT_EQ(scan.notes.size(), 1u);
}

TEST(Obj, FacesMayComeBeforeTheirVertices) {
  EXPECT_EQ(parse_scan("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n", "a.obj").triangles.size(), 1u);
  EXPECT_NE(input_error("f 1 2 4\nv 0 0 0\nv 1 0 0\nv 0 1 0\n", "a.obj")
                .find("line 1: the index 4 is out of range"),
            std::string::npos);
}

TEST(Obj, EveryWordOfAVertexAndANormalIsANumber) {
  const std::string face = "v 1 0 0\nv 0 1 0\nf 1 2 3\n";
  for (const char* statement : {"v 0 0 0 1 1 1 1 8 junk", "v 0 0 0 1 1 1 1 8 9 junk", "v 0 0 0 junk",
                                "vn 0 0 1 junk", "vn 0 0 1 0 junk", "vn 0 0 1 0 5 junk"})
    EXPECT_NE(input_error(std::string("v 0 0 0\n") + statement + "\n" + face, "a.obj")
                  .find("line 2: 'junk' is not a number"),
              std::string::npos)
        << statement;
  EXPECT_NE(input_error("v 0 0 0\nvn 0 0 1 0\n" + face, "a.obj").find("needs three numbers"),
            std::string::npos);
  EXPECT_EQ(parse_scan("v 0 0 0 1 1 1 1 8 9 10 # junk\nvn 0 0 1 # junk\n" + face, "a.obj").positions.size(),
            3u);
}

TEST(Obj, WithoutFacesItIsACloud) {
  const RawScan scan = parse_scan("v 0 0 0\nvn 0 0 1\nv 1 0 0\nvn 0 1 0\n", "a.obj");
  EXPECT_TRUE(scan.triangles.empty());
  EXPECT_EQ(scan.normals[1], (Vec3f{0, 1, 0}));
}

TEST(Obj, AnyPrefixIsReadOrRefused) {
  check_prefixes("v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nvn 0 0 1\r\ng x\r\nf 1//1 2//1 -1//1\r\n", "a.obj", 7);
}

const std::string kStlAscii =
    "solid one\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    "endsolid one\nsolid two\n facet normal nan nan nan\n outer loop\n vertex 1 0 0\n vertex 1 1 0\n vertex "
    "-0 1 0\n"
    " endloop\n endfacet\nendsolid two\n";

std::string stl_binary(const std::string& header, std::uint32_t count) {
  std::string bytes = header + std::string(80 - header.size(), ' ') + raw(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const float x = static_cast<float>(i);
    for (const float value : {0.f, 0.f, 1.f, x, 0.f, 0.f, x + 1, 0.f, 0.f, x, 1.f, 0.f}) bytes += raw(value);
    bytes += raw(std::uint16_t{0});
  }
  return bytes;
}

TEST(Stl, AsciiIsWeldedAndSolidsAreIds) {
  const RawScan scan = parse_scan(kStlAscii, "a.stl");
  EXPECT_EQ(scan.positions.size(), 4u);  // -0 is 0
  EXPECT_EQ(scan.triangles, (Triangles{{0, 1, 2}, {1, 3, 2}}));
  EXPECT_EQ(scan.object_ids, (Ids{0, 1}));
}

TEST(Stl, BinaryThatBeginsWithSolid) {
  for (const char* header : {"made by", "solid made by"}) {
    const RawScan scan = parse_scan(stl_binary(header, 3), "a.stl");
    EXPECT_EQ(scan.triangles.size(), 3u);
    EXPECT_EQ(scan.positions.size(), 7u);
  }
}

TEST(Stl, CutAnywhereIsAnError) {
  check_prefixes(kStlAscii.substr(0, kStlAscii.find("endsolid one") + 12), "a.stl",
                 kStlAscii.find("endsolid one") + 8);
  const std::string binary = stl_binary("solid", 2);
  check_prefixes(binary, "a.stl", binary.size());
}

TEST(Off, PlainAndVariants) {
  const std::string faces = "4 0 1 2 3 255 0 0\n3 0 1 2\n";
  RawScan scan = parse_scan("OFF\n# counts\n4 2 0\n0 0 0\n1 0 0 # here\n\n1 1 0\n0 1 0\n" + faces, "a.off");
  EXPECT_EQ(scan.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}}));
  EXPECT_EQ(scan.notes.size(), 1u);
  scan = parse_scan("OFF 4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n" + faces, "a.off");
  EXPECT_EQ(scan.triangles.size(), 3u);
  scan = parse_scan("4 2\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n" + faces, "a.off");
  EXPECT_EQ(scan.triangles.size(), 3u);
  scan = parse_scan("CNOFF\n1 0 0\n1 2 3 0 0 1 255 128 0 255\n", "a.off");
  EXPECT_EQ(scan.normals.at(0), (Vec3f{0, 0, 1}));
  EXPECT_EQ(scan.colors.at(0), (Color8{255, 128, 0}));
  scan = parse_scan("COFF\n1 0 0\n1 2 3 1.0 0.5 0 1\n", "a.off");
  EXPECT_EQ(scan.colors.at(0), (Color8{255, 128, 0}));
  scan = parse_scan("OFF\n1 0 0\n1 2 3 255 128 0\n", "a.off");
  EXPECT_EQ(scan.colors.at(0), (Color8{255, 128, 0}));
  scan = parse_scan("ST4OFF\n1 0 0\n2 4 6 2 0.5 0.5\n", "a.off");
  EXPECT_EQ(scan.positions.at(0), (Vec3d{1, 2, 3}));
}

TEST(Off, CutAnywhereIsAnError) {
  const std::string bytes = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
  check_prefixes(bytes, "a.off", bytes.size() - 1);
}

}  // namespace
}  // namespace rbvh
