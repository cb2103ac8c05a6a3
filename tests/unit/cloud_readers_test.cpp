// PCD and text.
#include "io/lzf.h"
#include "io/text_columns.h"
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

TEST(Pcd, NamesInAnyCaseAndSeparateColors) {
  for (const char* fields :
       {"X Y Z R G B NORMAL_X Normal_Y nz", "x y z red green blue NormalX NormalY NormalZ",
        "x y z Red Green Blue Nx Ny Nz"}) {
    std::string nine = fields;
    if (nine.find("nz") != std::string::npos) nine = "X Y Z R G B Normal_X NORMAL_Y normal_z";
    for (const char* type : {"U", "F"}) {
      const std::string t = type, size = t == "U" ? "1" : "4";
      const RawScan scan =
          parse_scan(pcd_header({nine, "4 4 4 " + size + " " + size + " " + size + " 4 4 4",
                                 "F F F " + t + " " + t + " " + t + " F F F", "1 1 1 1 1 1 1 1 1"},
                                "ascii") +
                         "0 0 0 200 100 50 0 0 1\n1 0 0 1 2 3 0 1 0\n\x1a",
                     "a.pcd");
      EXPECT_EQ(scan.colors, (std::vector<Color8>{{200, 100, 50}, {1, 2, 3}})) << fields;
      EXPECT_EQ(scan.normals[1], (Vec3f{0, 1, 0})) << fields;
      EXPECT_TRUE(scan.properties.empty());
    }
  }
  std::string small = pcd_header({"x y z", "4 4 4", "f f f", "1 1 1"}, "ASCII") + "0 0 0\n1 0 0\n";
  for (const char* key :
       {"VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"})
    small.replace(small.find(key), std::strlen(key), lower(key));
  EXPECT_EQ(parse_scan("\xef\xbb\xbf" + small, "a.pcd").positions.size(), 2u);
}

TEST(Xyz, PositionsByAnyName) {
  const std::vector<Vec3d> expected = {{0.5, 2, 3}, {-4, 5, 6}};
  for (const char* header : {"Z Y X", "z_coord y_coord x_coord", "\"Points:2\" \"Points:1\" \"Points:0\"",
                             "Elevation Northing Easting", "Height N E", "H North East", "Z[m] Y[m] X[m]",
                             "altitude POS_Y POS_X", "PositionZ PositionY PositionX"})
    for (const char separator : {' ', ',', ';', '\t'})
      for (const char* before :
           {"", "# made\n", "File of a scanner\nDate 1.1.2020\nUnits: metres\nby hand\n"}) {
        std::string text = std::string(header) + " code\n3 2 0.5 tree\n6 5 -4 wall\n";
        std::replace(text.begin(), text.end(), ' ', separator);
        EXPECT_EQ(parse_scan(before + text, "a.txt").positions, expected) << before << text;
      }
}

TEST(Xyz, AHeaderOfOtherThingsIsRefused) {
  for (const char* text : {"latitude,longitude,altitude\n48,11,500\n", "Lat Lon Height\n48 11 500\n",
                           "# lat;lon;h\n48;11;500\n", "time,Latitude,Longitude,Elevation\n0,69,-49,630\n",
                           "a,b,c\n1,2,3\n", "Intensity R G B\n1 2 3 4\n", "range;angle;height\n1;2;3\n"}) {
    try {
      parse_scan(text, "a.csv");
      ADD_FAILURE() << text;
    } catch (const ColumnsUnknown& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput) << text;
      EXPECT_NE(std::string(error.what()).find("the header '"), std::string::npos) << error.what();
    }
    EXPECT_EQ(parse_scan(text, "a.csv", {{"x", 3}, {"y", 1}, {"z", 2}}).positions.size(), 1u) << text;
  }
  EXPECT_EQ(parse_scan("# Scanned by me\n1 2 3\n", "a.xyz").positions.size(), 1u);
  EXPECT_EQ(parse_scan("my old church\n1 2 3\n", "a.xyz").positions.size(), 1u);
}

TEST(Xyz, ColumnsAsTheCallerNamesThem) {
  const RawScan scan = parse_scan("P1,9,8,7,255,0,0,tree\nP2,6,5,4,0,255,0,wall\n", "a.csv",
                                  {{"y", 2}, {"x", 3}, {"z", 4}, {"red", 5}, {"green", 6}, {"blue", 7}});
  EXPECT_EQ(scan.positions, (std::vector<Vec3d>{{8, 9, 7}, {5, 6, 4}}));
  EXPECT_EQ(scan.colors[1], (Color8{0, 255, 0}));
  EXPECT_THROW(parse_scan("1 2 3\n", "a.xyz", {{"x", 1}, {"y", 2}, {"z", 4}}), Error);
  EXPECT_THROW(parse_scan("1 2 3\n", "a.xyz", {{"x", 1}, {"y", 2}}), Error);
  EXPECT_THROW(parse_scan("OFF\n1 0 0\n1 2 3\n", "a.off", {{"x", 1}, {"y", 2}, {"z", 3}}), Error);
  EXPECT_NE(input_error("P1 1 2 3\n", "a.xyz").find("'P1' is no coordinate"), std::string::npos);
}

TEST(Xyz, DecimalCommas) {
  for (const char* text : {"0,5 1 0\n1,5 1,25 0\n", "0,5\t1\t0\n1,5\t1,25\t0\n", "0,5;1;0\n1,5;1,25;0\n",
                           "X Y Z\n0,5 1,0 0,0\n1,5 1,25 0\n", "0,5  1,0   0,00 \r\n1,5 1,25 0,\r\n"}) {
    if (std::string_view(text).ends_with("0,\r\n")) continue;
    EXPECT_EQ(parse_scan(text, "a.xyz").positions, (std::vector<Vec3d>{{0.5, 1, 0}, {1.5, 1.25, 0}})) << text;
  }
  EXPECT_EQ(parse_scan("1, 2, 3\n4, 5, 6\n", "a.xyz").positions[1], (Vec3d{4, 5, 6}));
  EXPECT_EQ(parse_scan("1,2,3\n4,5,6\n", "a.xyz").positions[1], (Vec3d{4, 5, 6}));
}

TEST(Xyz, IntensityBeforeOrBehindTheColor) {
  std::string before, behind;
  for (int i = 0; i < 20; ++i) {
    const int light = 40 + 9 * i, intensity = 10 + 77 * i % 200;
    const std::string rgb =
        std::to_string(light + 7) + " " + std::to_string(light) + " " + std::to_string(light / 2);
    before += std::to_string(i % 3) + " 0 0 " + std::to_string(intensity) + " " + rgb + "\n";
    behind += std::to_string(i % 3) + " 0 0 " + rgb + " " + std::to_string(intensity) + "\n";
  }
  for (const std::string& text : {before, behind}) {
    const RawScan scan = parse_scan(text, "a.xyz");
    EXPECT_EQ(scan.colors[1], (Color8{56, 49, 24})) << text;
    ASSERT_EQ(scan.properties.size(), 1u);
    EXPECT_EQ(scan.properties[0].values[1], 87);
    EXPECT_EQ(scan.notes.size(), 1u);
  }
}

TEST(Xyz, AFirstColumnThatCountsIsNoted) {
  EXPECT_EQ(parse_scan("1,50,40,0,GRD\n2,50,42,0,GRD\n3,51,40,0,GRD\n", "a.csv").notes.size(), 2u);
  EXPECT_TRUE(parse_scan("1 5 7\n2 6 7\n3 7 7\n", "a.xyz").notes.empty());
}

TEST(Xyz, SeveralScansOfOneFile) {
  const RawScan scan = parse_scan("2\r\n0 0 0 5\r\n1 0 0 5\r\n1\r\n2 0 0 5\r\n\x1a", "a.pts");
  EXPECT_EQ(scan.positions.size(), 3u);
  EXPECT_EQ(scan.object_ids, (std::vector<std::int32_t>{0, 0, 1}));
  EXPECT_NE(
      input_error("2\n0 0 0 5\n1 0 0 5\n2\n2 0 0 5\n", "a.pts").find("promises 2 points, but there are 1"),
      std::string::npos);
  EXPECT_NE(input_error("2\n0 0 0 5\n1\n2 0 0 5\n", "a.pts").find("columns"), std::string::npos);
}

const std::string kPtx =
    "2\n2\n10 20 30\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n"
    "1 0 0 0.5 255 0 0\n0 0 0 0.5 0 0 0\n0 1 0 0.25 0 255 0\n0 0 1 1 0 0 255\n";

TEST(Ptx, PointsMoveByTheirScansMatrix) {
  const RawScan one = parse_scan(kPtx, "a.ptx");
  EXPECT_EQ(one.positions, (std::vector<Vec3d>{{10, 21, 30}, {9, 20, 30}, {10, 20, 31}}));
  EXPECT_EQ(one.colors[1], (Color8{0, 255, 0}));
  EXPECT_EQ(one.properties.at(0).values, (std::vector<float>{0.5, 0.25, 1}));
  EXPECT_EQ(one.notes.size(), 1u);
  ASSERT_EQ(one.viewpoints.size(), 1u);
  EXPECT_EQ(one.viewpoints[0].position, (Vec3d{10, 20, 30}));
  const RawScan two = parse_scan("\xef\xbb\xbf" + kPtx + kPtx + "\x1a", "a.txt");
  EXPECT_EQ(two.object_ids, (std::vector<std::int32_t>{0, 0, 0, 1, 1, 1}));
  EXPECT_EQ(two.viewpoints.at(1).first_object, 1);
  check_prefixes(kPtx, "a.ptx", kPtx.size() - 3);
  std::string many = kPtx;
  many.replace(0, 3, "4000000000\n4000000000");
  EXPECT_NE(input_error(many, "a.ptx").find("promises"), std::string::npos);
}

TEST(Xyz, AnyPrefixIsReadOrRefused) { check_prefixes("# c\nx y z i\n1 2 3 4\n-5 6 7 8\n", "a.xyz", 15); }

}  // namespace
}  // namespace rbvh
