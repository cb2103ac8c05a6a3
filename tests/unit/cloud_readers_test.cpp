// PCD and text.
#include "io/lzf.h"
#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

struct PcdHeader {
  std::string fields, size, type, count;
  int width = 2, height = 1;
};

std::string pcd_header(const PcdHeader& h, const std::string& data) {
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS " + h.fields + "\nSIZE " + h.size +
         "\nTYPE " + h.type + "\nCOUNT " + h.count + "\nWIDTH " + std::to_string(h.width) + "\nHEIGHT " +
         std::to_string(h.height) + "\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS " +
         std::to_string(h.width * h.height) + "\nDATA " + data + "\n";
}

/// LZF with literals only.
std::string literals(const std::string& bytes) {
  std::string packed;
  for (std::size_t i = 0; i < bytes.size(); i += 32) {
    const std::string piece = bytes.substr(i, 32);
    packed += static_cast<char>(piece.size() - 1) + piece;
  }
  return packed;
}

const PcdHeader kXyz{"x y z", "4 4 4", "F F F", "1 1 1"};

TEST(Pcd, TheThreeEncodingsAgree) {
  const PcdHeader h{"x y z normal_x normal_y normal_z _ rgb intensity histogram", "8 8 8 4 4 4 1 4 2 4",
                    "F F F F F F U F U F", "1 1 1 1 1 1 4 1 1 2"};
  const double x[2] = {512345.678, 1}, y[2] = {5403210.125, 2},
               z[2] = {-1e-3, std::numeric_limits<double>::quiet_NaN()};
  const std::uint32_t rgb[2] = {0x00ff8001, 0x00030201};
  const std::uint16_t intensity[2] = {65535, 7};
  std::string rows, text;
  for (int i = 0; i < 2; ++i) {
    rows += raw(x[i]) + raw(y[i]) + raw(z[i]) + raw(0.f) + raw(0.f) + raw(1.f) + std::string(4, '\1') +
            raw(rgb[i]) + raw(intensity[i]) + raw(1.f) + raw(2.f);
    float packed;
    std::memcpy(&packed, &rgb[i], 4);
    char line[256];
    std::snprintf(line, sizeof line, "%.17g %.17g %.17g 0 0 1 1 1 1 1 %.9g %d 1 2\n", x[i], y[i], z[i],
                  static_cast<double>(packed), intensity[i]);
    text += line;
  }
  std::string columns;
  const auto column = [&](auto of) {
    for (int i = 0; i < 2; ++i) columns += of(i);
  };
  column([&](int i) { return raw(x[i]); });
  column([&](int i) { return raw(y[i]); });
  column([&](int i) { return raw(z[i]); });
  column([&](int) { return raw(0.f); });
  column([&](int) { return raw(0.f); });
  column([&](int) { return raw(1.f); });
  column([&](int) { return std::string(4, '\1'); });
  column([&](int i) { return raw(rgb[i]); });
  column([&](int i) { return raw(intensity[i]); });
  column([&](int) { return raw(1.f) + raw(2.f); });
  const std::string packed = literals(columns);
  const std::string compressed = raw(static_cast<std::uint32_t>(packed.size())) +
                                 raw(static_cast<std::uint32_t>(columns.size())) + packed;

  for (const auto& bytes : {pcd_header(h, "ascii") + text, pcd_header(h, "binary") + rows,
                            pcd_header(h, "binary_compressed") + compressed}) {
    const RawScan scan = parse_scan(bytes, "a.pcd");
    ASSERT_EQ(scan.positions.size(), 2u);
    EXPECT_EQ(scan.positions[0], (Vec3d{x[0], y[0], z[0]}));
    EXPECT_TRUE(std::isnan(scan.positions[1].z));
    EXPECT_EQ(scan.normals[0], (Vec3f{0, 0, 1}));
    EXPECT_EQ(scan.colors, (std::vector<Color8>{{255, 128, 1}, {3, 2, 1}}));
    ASSERT_EQ(scan.properties.size(), 1u);
    EXPECT_EQ(scan.properties[0].name, "intensity");
    EXPECT_EQ(scan.properties[0].values, (std::vector<float>{65535, 7}));
    EXPECT_EQ(scan.notes.size(), 1u);  // histogram
    ASSERT_EQ(scan.viewpoints.size(), 1u);
    EXPECT_EQ(scan.viewpoints[0].position, (Vec3d{1, 2, 3}));
    EXPECT_FALSE(scan.viewpoints[0].is_default);
  }
}

TEST(Pcd, PackedColorsOfIntegerTypeAndAlpha) {
  const RawScan scan = parse_scan(pcd_header({"x y z rgba", "4 4 4 4", "F F F U", "1 1 1 1"}, "ascii") +
                                      "0 0 0 4286545791\n1 0 0 16711680\n",
                                  "a.pcd");
  EXPECT_EQ(scan.colors, (std::vector<Color8>{{0x7f, 0x7f, 0x7f}, {255, 0, 0}}));
  ASSERT_EQ(scan.properties.size(), 1u);
  EXPECT_EQ(scan.properties[0].values, (std::vector<float>{255, 0}));
}

TEST(Pcd, ZeroPaddingIsNoNews) {
  const std::string body = raw(0.f) + raw(0.f) + raw(0.f) + raw(1.f) + raw(1.f) + raw(1.f);
  EXPECT_TRUE(parse_scan(pcd_header(kXyz, "binary") + body + std::string(100, '\0'), "a.pcd").notes.empty());
  EXPECT_EQ(parse_scan(pcd_header(kXyz, "binary") + body + "rest", "a.pcd").notes.size(), 1u);
}

TEST(Pcd, CutAnywhereIsAnError) {
  const std::string body = raw(0.f) + raw(0.f) + raw(0.f) + raw(1.f) + raw(1.f) + raw(1.f);
  const std::string binary = pcd_header(kXyz, "binary") + body;
  check_prefixes(binary, "a.pcd", binary.size());
  const std::string packed = literals(body);
  const std::string compressed = pcd_header(kXyz, "binary_compressed") +
                                 raw(static_cast<std::uint32_t>(packed.size())) +
                                 raw(static_cast<std::uint32_t>(body.size())) + packed;
  EXPECT_EQ(parse_scan(compressed, "a.pcd").positions.size(), 2u);
  check_prefixes(compressed, "a.pcd", compressed.size());
  const std::string ascii = pcd_header(kXyz, "ascii") + "0 0 0\n1 1 1\n";
  check_prefixes(ascii, "a.pcd", ascii.size() - 1);
}

TEST(Lzf, ReferencesAndDamage) {
  const auto unpack = [](const std::string& in, std::size_t size) {
    std::string out(size, '?');
    const bool ok = lzf_decompress({reinterpret_cast<const unsigned char*>(in.data()), in.size()},
                                   {reinterpret_cast<unsigned char*>(out.data()), out.size()});
    return ok ? out : "damaged";
  };
  // "ab", then 5 bytes from 2 back (overlapping), then 12 bytes from 1 back by the long form.
  const std::string packed =
      std::string("\x01") + "ab" + "\x60" + "\x01" + "\xe0" + "\x03" + std::string(1, '\0');
  EXPECT_EQ(unpack(packed, 19), "abababa" + std::string(12, 'a'));
  EXPECT_EQ(unpack(packed, 18), "damaged");
  EXPECT_EQ(unpack(packed, 20), "damaged");
  EXPECT_EQ(unpack("\x60\x05", 5), "damaged");
  for (std::size_t size = 1; size < packed.size(); ++size)
    EXPECT_EQ(unpack(packed.substr(0, size), 19), "damaged");
}

TEST(Xyz, SeparatorsCommentsAndHeaders) {
  const std::vector<Vec3d> expected = {{1, 2, 3}, {-4.5, 5e-1, 6}};
  for (const char* text : {"1 2 3\n-4.5 .5 6\n", "1,2,3\n-4.5,0.5,6\n", "1;2;3\r\n-4.5;0.5;6\r\n",
                           "1\t2\t3\n-4.5\t0.5\t6", "1, 2, 3,\n-4.5, 0.5, 6,\n",
                           "# made\n// by\n1 2 3\n\n  -4.5   0.5 6  \n", "x,y,z\n1,2,3\n-4.5,0.5,6\n",
                           "made by hand\n\"X\" \"Y\" \"Z\"\n1 2 3\n-4.5 0.5 6\n", "2\n1 2 3\n-4.5 0.5 6\n",
                           "\xef\xbb\xbf"
                           "1 2 3\n-4.5 0.5 6\n",
                           "1;2;3\n-4,5;0,5;6\n"}) {
    const RawScan scan = parse_scan(text, "a.xyz");
    EXPECT_EQ(scan.positions, expected) << text;
    EXPECT_TRUE(scan.properties.empty()) << text;
  }
}

TEST(Xyz, NamedColumns) {
  const RawScan scan = parse_scan(
      "id,Z,Y,X,Red,Green,Blue,nx,ny,nz,gps\n1,3,2,1,9,8,7,0,0,1,42\n2,6,5,4,9,8,7,0,1,0,\n", "a.csv");
  EXPECT_EQ(scan.positions, (std::vector<Vec3d>{{1, 2, 3}, {4, 5, 6}}));
  EXPECT_EQ(scan.colors[0], (Color8{9, 8, 7}));
  EXPECT_EQ(scan.normals[1], (Vec3f{0, 1, 0}));
  ASSERT_EQ(scan.properties.size(), 2u);
  EXPECT_EQ(scan.properties[0].name, "id");
  EXPECT_EQ(scan.properties[1].name, "gps");
  EXPECT_TRUE(std::isnan(scan.properties[1].values[1]));
  const RawScan other = parse_scan("//X Y Z R G B Intensity\n1 2 3 9 8 7 0.5\n", "a.asc");
  EXPECT_EQ(other.colors[0], (Color8{9, 8, 7}));
  EXPECT_EQ(other.properties[0].name, "Intensity");
}

TEST(Xyz, UnnamedColumns) {
  EXPECT_EQ(parse_scan("0 0 0 0 0 1\n1 0 0 0.6 0.8 0\n", "a.xyz").normals[1], (Vec3f{0.6f, 0.8f, 0}));
  EXPECT_EQ(parse_scan("0 0 0 0 0 1\n1 0 0 255 8 0\n", "a.xyz").colors[1], (Color8{255, 8, 0}));
  EXPECT_EQ(parse_scan("0 0 0 0 0.5 0\n1 0 0 1 0.5 0\n", "a.xyz").colors[0], (Color8{0, 128, 0}));
  const RawScan four = parse_scan("0 0 0 17.5\n1 0 0 -3\n", "a.xyz");
  EXPECT_EQ(four.properties.at(0).name, "intensity");
  const RawScan six = parse_scan("0 0 0 17.5 1 2\n1 0 0 -3 4 5\n", "a.xyz");
  EXPECT_EQ(six.properties.size(), 3u);
  const RawScan nine = parse_scan("0 0 0 10 20 30 0 0 1\n1 0 0 40 50 60 0 1 0\n", "a.xyz");
  EXPECT_EQ(nine.colors[1], (Color8{40, 50, 60}));
  EXPECT_EQ(nine.normals[1], (Vec3f{0, 1, 0}));
  const std::string seven = "0 0 0 200 10 20 30\n1 0 0 201 40 50 60\n";
  EXPECT_EQ(parse_scan("2\n" + seven, "a.pts").colors[0], (Color8{10, 20, 30}));
  EXPECT_EQ(parse_scan(seven, "a.xyz").colors[0], (Color8{200, 10, 20}));
}

TEST(Xyz, TextCellsAreNoted) {
  const RawScan scan = parse_scan("1 2 3 tree\n4 5 6 7\n", "a.xyz");
  EXPECT_TRUE(std::isnan(scan.properties.at(0).values[0]));
  EXPECT_EQ(scan.notes.size(), 1u);
}

TEST(Xyz, AnyPrefixIsReadOrRefused) { check_prefixes("# c\nx y z i\n1 2 3 4\n-5 6 7 8\n", "a.xyz", 15); }

}  // namespace
}  // namespace rbvh
