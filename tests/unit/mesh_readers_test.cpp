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
  EXPECT_EQ(scan.notes,
            (std::vector<std::string>{"its materials are not there: 'a.mtl'", "'vt' (1) is not kept"}));
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

TEST(Obj, EveryWordOfAVertexIsANumber) {
  const std::string face = "v 1 0 0\nv 0 1 0\nf 1 2 3\n";
  for (const char* statement : {"v 0 0 0 1 1 1 1 8 junk", "v 0 0 0 1 1 1 1 8 9 junk", "v 0 0 0 junk"})
    EXPECT_NE(input_error(std::string("v 0 0 0\n") + statement + "\n" + face, "a.obj")
                  .find("line 2: 'junk' is not a number"),
              std::string::npos)
        << statement;
  EXPECT_EQ(parse_scan("v 0 0 0 1 1 1 1 8 9 10 # junk\nvn 0 0 1 # junk\n" + face, "a.obj").positions.size(),
            3u);
}

TEST(Obj, ABadNormalCostsTheNormalAlone) {
  for (const char* bad : {"vn 0 0", "vn", "vn 0 0 up", "vn 0 0 1 0", "vn 0 0 1 junk", "vn 0,5 0 1"}) {
    const RawScan scan = parse_scan(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt a b\nvn 0 0 1\n" + std::string(bad) + "\nf 1//1 2//2 3//1\n", "a.obj");
    EXPECT_EQ(scan.normals, (std::vector<Vec3f>{{0, 0, 1}, {0, 0, 0}, {0, 0, 1}})) << bad;
    ASSERT_FALSE(scan.notes.empty());
    EXPECT_EQ(scan.notes[0].find("1 normals are no three numbers"), 0u) << scan.notes[0];
  }
}

TEST(Obj, StatementsContinueButNoCommentsAndNames) {
  const std::string rest = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  for (const char* line :
       {"# C:\\scans\\", "#\\", "  # c \\ ", "o a\\", "g C:\\", "usemtl m\\\t", "mtllib C:\\m\\"})
    for (const char* end : {"\n", "\r\n"}) {
      const RawScan scan = parse_scan(line + std::string(end) + rest, "a.obj");
      EXPECT_EQ(scan.positions.size(), 3u) << line;
      EXPECT_EQ(scan.triangles.size(), 1u) << line;
    }
  for (const char* text : {"v 0 0\\\n0\nv 1 0 0\nv 0 1 0\nf 1 2\\  \r\n 3\n",
                           "v 0 \\\t\n0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 2 3\\"}) {
    const RawScan scan = parse_scan(text, "a.obj");
    EXPECT_EQ(scan.positions.size(), 3u) << text;
    EXPECT_EQ(scan.triangles, (Triangles{{0, 1, 2}})) << text;
  }
}

TEST(Obj, ColorsWithAlphaOrWeight) {
  const std::string face = "f 1 2 3\n";
  // red green blue alpha; weight red green blue; and what can be both is colours with an opaque alpha.
  EXPECT_EQ(parse_scan("v 0 0 0 .8 .4 .2 1\nv 1 0 0 0 1 0 1\nv 0 1 0 1 1 1 1\n" + face, "a.obj").colors,
            (std::vector<Color8>{{204, 102, 51}, {0, 255, 0}, {255, 255, 255}}));
  EXPECT_EQ(parse_scan("v 0 0 0 1 .8 .4 .2\nv 1 0 0 1 0 1 0\nv 0 1 0 1 1 1 1\n" + face, "a.obj").colors,
            (std::vector<Color8>{{204, 102, 51}, {0, 255, 0}, {255, 255, 255}}));
  EXPECT_EQ(parse_scan("v 0 0 0 1 0 0 1\nv 1 0 0 1 0 0 1\nv 0 1 0 1 0 0 1\n" + face, "a.obj").colors[0],
            (Color8{255, 0, 0}));
}

TEST(Obj, AShortFaceOnACompleteLastLineIsCounted) {
  const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  EXPECT_EQ(parse_scan(points + "f 1 2\n", "a.obj").notes.size(), 1u);
  EXPECT_NE(input_error(points + "f 1 2", "a.obj").find("cut"), std::string::npos);
}

double area(const RawScan& scan) {
  double sum = 0;
  for (const Triangle& t : scan.triangles)
    sum += length(cross(scan.positions[t[1]] - scan.positions[t[0]],
                        scan.positions[t[2]] - scan.positions[t[0]])) /
           2;
  return sum;
}

/// The polygon in each format, turned by `start` corners, in the plane that `axis` is normal to.
std::vector<std::pair<std::string, std::string>> as_files(std::vector<std::array<double, 2>> corners,
                                                          std::size_t start, int axis, bool reversed) {
  std::rotate(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(start), corners.end());
  if (reversed) std::reverse(corners.begin(), corners.end());
  const std::string n = std::to_string(corners.size());
  std::string rows, obj, face, obj_face = "f";
  for (std::size_t i = 0; i < corners.size(); ++i) {
    double p[3] = {500000, 500000, 500000};
    p[(axis + 1) % 3] += corners[i][0];
    p[(axis + 2) % 3] += corners[i][1];
    char row[128];
    std::snprintf(row, sizeof row, "%.17g %.17g %.17g\n", p[0], p[1], p[2]);
    rows += row;
    obj += std::string("v ") + row;
    face += " " + std::to_string(i);
    obj_face += " " + std::to_string(i + 1);
  }
  return {{"a.obj", obj_face + "\n" + obj},
          {"a.off", "OFF\n" + n + " 1 0\n" + rows + n + face + "\n"},
          {"a.ply",
           "ply\nformat ascii 1.0\nelement face 1\nproperty list int int vertex_indices\nelement vertex " +
               n + "\nproperty double x\nproperty double y\nproperty double z\nend_header\n" + n + face +
               "\n" + rows}};
}

TEST(Polygons, ConcaveOnesAreFilledInEveryFormat) {
  struct Shape {
    double area;
    std::vector<std::array<double, 2>> corners;
  };
  std::vector<Shape> shapes = {
      {3, {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}},
      {0.25, {{0, 0}, {2, -.5}, {.5, 0}, {2, .5}}},
      {7, {{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}}},
      {16, {{4, 0}, {1, 1}, {0, 4}, {-1, 1}, {-4, 0}, {-1, -1}, {0, -4}, {1, -1}}},
      {4, {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}},  // corners on straight lines
      {15, {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 2}, {2, 2}, {2, 1}, {1, 1}}},  // with a hole
  };
  Shape comb{0, {{0, 0}}};
  for (int i = 0; i < 50; ++i) {
    comb.corners.push_back({i + 0.5, 10.0 + i % 7});
    comb.corners.push_back({i + 1.0, 1});
  }
  comb.corners.push_back({50, 0});
  for (std::size_t i = 0; i < comb.corners.size(); ++i) {
    const auto &a = comb.corners[i], &b = comb.corners[(i + 1) % comb.corners.size()];
    comb.area += (a[0] * b[1] - a[1] * b[0]) / 2;
  }
  comb.area = std::abs(comb.area);
  shapes.push_back(comb);
  for (const Shape& shape : shapes)
    for (std::size_t start = 0; start < std::min<std::size_t>(shape.corners.size(), 11); ++start)
      for (int axis = 0; axis < 3; ++axis)
        for (const bool reversed : {false, true})
          for (const auto& [name, bytes] : as_files(shape.corners, start, axis, reversed)) {
            const RawScan scan = parse_scan(bytes, name);
            EXPECT_NEAR(area(scan), shape.area, 1e-6) << bytes;
            EXPECT_EQ(scan.triangles.size(), shape.corners.size() - 2);
            EXPECT_TRUE(scan.notes.empty()) << scan.notes[0];
            const Triangle t = scan.triangles[0];
            const Vec3d n = cross(scan.positions[t[1]] - scan.positions[t[0]],
                                  scan.positions[t[2]] - scan.positions[t[0]]);
            for (const Triangle& other : scan.triangles)
              EXPECT_GE(dot(n, cross(scan.positions[other[1]] - scan.positions[other[0]],
                                     scan.positions[other[2]] - scan.positions[other[0]])),
                        0)
                  << bytes;
          }
}

TEST(Polygons, CrossingEdgesAreCounted) {
  for (const auto& corners : {std::vector<std::array<double, 2>>{{0, 0}, {1, 1}, {1, 0}, {0, 1}},
                              {{0, 0}, {2, 2}, {2, 0}, {0, 1}},
                              {{0, 3}, {2, -3}, {-3, 1}, {3, 1}, {-2, -3}}})
    for (const auto& [name, bytes] : as_files(corners, 0, 2, false)) {
      const RawScan scan = parse_scan(bytes, name);
      EXPECT_EQ(scan.triangles.size(), corners.size() - 2);
      ASSERT_EQ(scan.notes.size(), 1u) << bytes;
      EXPECT_EQ(scan.notes[0].find("1 polygons have edges that cross"), 0u);
    }
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

TEST(Stl, KeywordsInAnyCaseAndSpelling) {
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
    return text;
  };
  std::string upper = kStlAscii, mixed = replaced(kStlAscii, "endsolid", "ENDSOLID");
  for (char& c : upper) c = static_cast<char>(std::toupper(c));
  const std::string apart = replaced(replaced(kStlAscii, "endloop", "end loop"), "endfacet", "End Facet");
  for (const std::string& text :
       {upper, mixed, apart, replaced(apart, "endsolid", "end solid"), replaced(kStlAscii, "solid", "Solid"),
        "\xef\xbb\xbf" + kStlAscii, "  \n " + kStlAscii, kStlAscii + "\x1a", kStlAscii + "\r\n\x1a\r\n",
        replaced(kStlAscii, "\n", "\r")}) {
    const RawScan scan = parse_scan(text, "a.stl");
    EXPECT_EQ(scan.positions.size(), 4u) << text;
    EXPECT_EQ(scan.triangles.size(), 2u) << text;
    EXPECT_EQ(scan.object_ids, (Ids{0, 1})) << text;
  }
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

TEST(Off, KeywordsInAnyCaseAndGlued) {
  const std::string body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
  for (const char* head : {"OFF4 1 0\n", "off4 1 0\n", "off\n4 1 0\n", "Off\n4 1\n", "oFf 4 1 0\n",
                           "\xef\xbb\xbfOFF\n4 1 0\n", "# made\nOFF4 1 0\n"})
    for (const char* end : {"", "\x1a", "\r\n\x1a"}) {
      const RawScan scan = parse_scan(head + body + end, "a.off");
      EXPECT_EQ(scan.positions.size(), 4u) << head;
      EXPECT_EQ(scan.triangles.size(), 2u) << head;
    }
  const std::string color =
      "0 0 0 255 0 0 255\n1 0 0 0 128 0 255\n1 1 0 9 8 7 255\n0 1 0 1 2 3 255\n4 0 1 2 3\n";
  for (const char* head : {"COFF4 1 0\n", "coff4 1 0\n", "coff\n4 1 0\n", "cOFF 4 1 0\n"})
    EXPECT_EQ(parse_scan(head + color, "a.off").colors[1], (Color8{0, 128, 0})) << head;
  EXPECT_EQ(parse_scan("noff1 0 0\n1 2 3 0 0 1\n", "a.off").normals[0], (Vec3f{0, 0, 1}));
}

TEST(Off, NormalBeforeOrBehindTheColor) {
  for (const char* head : {"NCOFF\n", "CNOFF\n", "ncoff\n"})
    for (const bool normal_first : {false, true}) {
      std::string bytes = std::string(head) + "2 0 0\n";
      for (const char* normal : {"0 0 1", "0 -1 0"})
        bytes += std::string("1 2 3 ") + (normal_first ? normal : "255 128 0 255") + " " +
                 (normal_first ? "255 128 0 255" : normal) + "\n";
      const RawScan scan = parse_scan(bytes, "a.off");
      EXPECT_EQ(scan.normals, (std::vector<Vec3f>{{0, 0, 1}, {0, -1, 0}})) << bytes;
      EXPECT_EQ(scan.colors[0], (Color8{255, 128, 0})) << bytes;
    }
}

TEST(Off, CutAnywhereIsAnError) {
  const std::string bytes = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
  check_prefixes(bytes, "a.off", bytes.size() - 1);
}

}  // namespace
}  // namespace rbvh
