// LAS: every version and point format, against values that were put in.
#include "io/las.h"

#include "tests/las_file.h"
#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

const std::vector<LasPoint> kPoints = {{1, 2, 3, 65535, 2, false, {65535, 257, 0}},
                                       {-2147483647 - 1, 2147483647, -5, 7, 6, true, {1, 2, 3}},
                                       {-100, 200, -300, 0, 31, false, {32768, 0, 300}}};

std::string record(const std::string& user, std::uint16_t number, const std::string& body) {
  std::string head = raw(std::uint16_t{0}) + user;
  head.resize(18, '\0');
  head += raw(number) + raw(static_cast<std::uint16_t>(body.size()));
  head.resize(54, '\0');
  return head + body;
}

bool has_note(const RawScan& scan, const std::string& words) {
  return std::any_of(scan.notes.begin(), scan.notes.end(),
                     [&](const std::string& note) { return note.find(words) != std::string::npos; });
}

TEST(Las, EveryVersionAndPointFormat) {
  for (int minor = 0; minor <= 4; ++minor)
    for (int format = 0; format <= 10; ++format)
      for (const std::size_t extra : {0u, 5u}) {
        SCOPED_TRACE("1." + std::to_string(minor) + ", format " + std::to_string(format));
        if (format >= 6 && minor < 4) continue;
        LasFile file{.minor = minor, .format = format, .points = kPoints, .extra_bytes = extra};
        if (minor == 0) file.points[1].is_withheld = false;
        const RawScan scan = parse_scan(file.bytes(), "scan");  // by content
        const std::size_t last = minor == 0 ? 2 : 1;
        ASSERT_EQ(scan.positions.size(), last + 1);
        EXPECT_EQ(scan.positions[0], (Vec3d{1 * 0.01 + 500000.25, 2 * 0.001 + 5400000.5, 3 * 0.5 - 10}));
        EXPECT_EQ(scan.positions[last], (Vec3d{-100 * 0.01 + 500000.25, 200 * 0.001 + 5400000.5, -160}));
        ASSERT_EQ(scan.properties.size(), 2u);
        EXPECT_EQ(scan.properties[0].name, "intensity");
        EXPECT_EQ(scan.properties[0].values.front(), 65535);
        EXPECT_EQ(scan.properties[0].values.back(), 0);
        EXPECT_EQ(scan.properties[1].name, "classification");
        EXPECT_EQ(scan.properties[1].values.front(), 2);
        EXPECT_EQ(scan.properties[1].values.back(), 31);
        ASSERT_EQ(scan.colors.size(), kLasColorAt[format] ? last + 1 : 0);
        if (kLasColorAt[format]) {
          EXPECT_EQ(scan.colors[0], (Color8{255, 1, 0}));
          EXPECT_EQ(scan.colors[last], (Color8{128, 0, 1}));
        }
        EXPECT_EQ(has_note(scan, "1 points are marked as withheld"), minor > 0);
        EXPECT_EQ(has_note(scan, "5 extra bytes a point are not kept"), extra > 0);
      }
}

TEST(Las, AClassOfAllBits) {
  LasFile file{.minor = 4, .format = 6, .points = kPoints};
  file.points[0].classification = 255;
  EXPECT_EQ(parse_scan(file.bytes(), "a.las").properties[1].values[0], 255);
  file = {.minor = 0, .format = 0, .points = kPoints};
  file.points[1].is_withheld = false;
  file.points[1].classification = 0x85;  // 1.0 has no flags there
  EXPECT_EQ(parse_scan(file.bytes(), "a.las").properties[1].values[1], 0x85);
}

TEST(Las, ColoursOfEightBitsAndNone) {
  LasFile file{.format = 2, .points = kPoints};
  file.points[0].color = {255, 128, 1};
  file.points[2].color = {0, 7, 9};
  RawScan scan = parse_scan(file.bytes(), "a.las");
  EXPECT_EQ(scan.colors, (std::vector<Color8>{{255, 128, 1}, {0, 7, 9}}));
  EXPECT_TRUE(has_note(scan, "8 bits"));
  file.points[2].color = {0, 256, 0};
  scan = parse_scan(file.bytes(), "a.las");
  EXPECT_EQ(scan.colors[1], (Color8{0, 1, 0}));
  EXPECT_FALSE(has_note(scan, "8 bits"));
  file.points[0].color = file.points[2].color = {};
  scan = parse_scan(file.bytes(), "a.las");
  EXPECT_TRUE(scan.colors.empty());
  EXPECT_TRUE(has_note(scan, "all colours are 0"));
}

TEST(Las, UtmKeepsItsDigits) {
  const Scan scan =
      shift_to_float(parse_scan(LasFile{.points = {{1, 2, 3}, {2, 3, 3}, {4, 1, 9}}}.bytes(), "a.las"));
  EXPECT_EQ(scan.shift.x, 500000);
  EXPECT_NEAR(scan.positions[1].x - scan.positions[0].x, 0.01, 1e-7);
  EXPECT_NEAR(scan.positions[1].y - scan.positions[0].y, 0.001, 1e-7);
}

TEST(Las, TheTwoCounts) {
  LasFile file{.minor = 4, .format = 3, .points = kPoints};
  EXPECT_EQ(parse_scan(file.bytes(), "a.las").positions.size(), 2u);
  file.old_count = 0;
  EXPECT_EQ(parse_scan(file.bytes(), "a.las").positions.size(), 2u);
  file.old_count = 3;
  file.new_count = 0;
  EXPECT_EQ(parse_scan(file.bytes(), "a.las").positions.size(), 2u);
  file.new_count = 99;
  const RawScan scan = parse_scan(file.bytes(), "a.las");
  EXPECT_EQ(scan.positions.size(), 2u);
  EXPECT_TRUE(has_note(scan, "two counts of points, 3 and 99; 3 were read"));
  file.old_count = 98;
  EXPECT_NE(input_error(file.bytes(), "a.las").find("promises 99 points, but there are bytes for 3"),
            std::string::npos);
}

TEST(Las, CountsThatAreWrong) {
  LasFile file{.points = kPoints, .old_count = 4};
  EXPECT_NE(input_error(file.bytes(), "a.las").find("promises 4 points, but there are bytes for 3"),
            std::string::npos);
  file.old_count = 0;
  EXPECT_NE(input_error(file.bytes(), "a.las").find("bytes for 3: whoever wrote it was interrupted"),
            std::string::npos);
  file.old_count = 1;
  EXPECT_TRUE(has_note(parse_scan(file.bytes(), "a.las"), "40 bytes follow the last point"));
  file.old_count = 3;
  file.behind = std::string(100, '\0');
  EXPECT_FALSE(has_note(parse_scan(file.bytes(), "a.las"), "bytes follow"));
}

TEST(Las, RecordsBehindThePointsAreNoPoints) {
  LasFile file{.minor = 4, .format = 6, .points = kPoints, .behind = std::string(90, 'x')};
  std::string bytes = file.bytes();
  LasFile::put(bytes, 235, static_cast<std::uint64_t>(bytes.size() - 90));
  LasFile::put(bytes, 243, std::uint32_t{1});
  EXPECT_FALSE(has_note(parse_scan(bytes, "a.las"), "bytes follow"));
  LasFile::put(bytes, 247, std::uint64_t{4});
  EXPECT_NE(input_error(bytes, "a.las").find("bytes for 3"), std::string::npos);
}

TEST(Las, DegreesAreRefused) {
  const std::string keys =
      raw(std::uint64_t{0}) + raw(std::uint16_t{1024}) + raw(std::uint16_t{0}) + raw(std::uint16_t{1});
  for (const auto& [body, number, refused] :
       {std::tuple{keys + raw(std::uint16_t{2}), 34735, true},
        {keys + raw(std::uint16_t{1}), 34735, false},
        {std::string("GEOGCS[\"WGS 84\"]"), 2112, true},
        {std::string("PROJCS[\"UTM\",GEOGCS[\"WGS 84\"]]"), 2112, false}}) {
    const LasFile file{.points = kPoints,
                       .records = record("other", 7, "abc") +
                                  record("LASF_Projection", static_cast<std::uint16_t>(number), body),
                       .record_count = 2};
    if (refused)
      EXPECT_NE(input_error(file.bytes(), "a.las").find("degrees"), std::string::npos);
    else
      EXPECT_EQ(parse_scan(file.bytes(), "a.las").positions.size(), 2u);
  }
}

TEST(Las, CompressedOnesAreNamed) {
  ASSERT_EQ(setenv("PATH", "/nowhere", 1), 0);  // no rbvh-convert
  std::string bytes = LasFile{.points = kPoints}.bytes();
  bytes[104] = static_cast<char>(0x80);
  for (const char* name : {"a.laz", "a.copc.laz", "a.las"})
    EXPECT_NE(input_error(bytes, name).find("is compressed (LAZ or COPC)"), std::string::npos);
  EXPECT_NE(input_error("not a las", "a.las").find("LASF"), std::string::npos);
}

TEST(Las, CutAnywhere) {
  const LasFile file{
      .minor = 4, .format = 8, .points = kPoints, .records = record("x", 1, "abc"), .record_count = 1};
  const std::string bytes = file.bytes();
  check_prefixes(bytes, "a.las", bytes.size());
}

}  // namespace
}  // namespace rbvh
