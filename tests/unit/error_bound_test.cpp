// Errors as people write them.
#include "pipeline/base/error_bound.h"

#include <gtest/gtest.h>

#include <tuple>

#include "pipeline/base/error.h"
#include "pipeline/base/units.h"
#include "pipeline/rbvh/build_options.h"
#include "tests/usage_refusal.h"

namespace rbvh {
namespace {

TEST(ErrorBound, IsANumberAndAUnit) {
  for (const auto& [text, value, unit] : {std::tuple{"0.5mm", 0.5, "mm"},
                                          {"2", 2.0, ""},
                                          {"1e-3in", 1e-3, "in"},
                                          {"0.01%", 0.01, "%"},
                                          {"3units", 3.0, "units"},
                                          {"1.5km", 1.5, "km"},
                                          {"1cm", 1.0, "cm"},
                                          {"1m", 1.0, "m"},
                                          {"7ft", 7.0, "ft"}}) {
    const ErrorBound error = parse_error_bound(text);
    EXPECT_EQ(error.value, value) << text;
    EXPECT_EQ(error.unit, unit) << text;
  }
  for (const char* text : {"", "mm", "0", "0mm", "-1mm", "1 mm", "1MM", "1um", "1e", "nan", "infmm", "1mmm",
                           "1e999", "0x1", "1,5mm"})
    EXPECT_NE(usage_refusal([&] { parse_error_bound(text); }).find("is not a number above 0"),
              std::string::npos)
        << text;
}

TEST(ErrorBound, IsConvertedByTheScansUnits) {
  const auto part = [](const char* text, const char* bare, const char* scan_units) {
    return part_of_diagonal(parse_error_bound(text), bare, {200, scan_units}, "a.ply");
  };
  EXPECT_DOUBLE_EQ(part("0.5mm", "units", "mm"), 0.5 / 200);
  EXPECT_DOUBLE_EQ(part("0.5mm", "units", "m"), 0.0005 / 200);
  EXPECT_DOUBLE_EQ(part("1m", "units", "cm"), 100.0 / 200);
  EXPECT_DOUBLE_EQ(part("1in", "units", "mm"), 25.4 / 200);
  EXPECT_DOUBLE_EQ(part("1ft", "units", "in"), 12.0 / 200);
  EXPECT_DOUBLE_EQ(part("1km", "units", "m"), 1000.0 / 200);
  EXPECT_DOUBLE_EQ(part("0.02%", "units", ""), 0.0002);
  EXPECT_DOUBLE_EQ(part("0.02", "%", ""), 0.0002);
  EXPECT_DOUBLE_EQ(part("0.02", "units", "mm"), 0.02 / 200) << "a bare number is in scan units";
  EXPECT_DOUBLE_EQ(part("0.02units", "%", ""), 0.02 / 200);
  for (const char* unknown : {"", "unknown", "furlong"})
    EXPECT_NE(usage_refusal([&] {
                part("0.5mm", "units", unknown);
              }).find("a.ply: its units are not known, so an error in mm says nothing"),
              std::string::npos);
}

TEST(ErrorBound, LevelsMayHaveOneEach) {
  const std::vector<WantedLevel> levels = parse_wanted_levels("Q0=1e-5,Q2,Q4=5e-4");
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0].name, "Q0");
  EXPECT_EQ(levels[0].error, 1e-5);
  EXPECT_EQ(levels[1].name, "Q2");
  EXPECT_FALSE(levels[1].error);
  EXPECT_EQ(levels[2].error, 5e-4);
  for (const char* text : {"Q0=", "Q0=0", "Q0=1e-5=2", "Q0=nan", "Q0=1e-5,,Q2", "Q0=1mm"})
    usage_refusal([&] { parse_wanted_levels(text); });
}

TEST(Units, AreThoseThatMessagesList) {
  EXPECT_EQ(unit_meters("ft"), 0.3048);
  EXPECT_EQ(unit_meters("mm"), 0.001);
  EXPECT_FALSE(unit_meters(""));
  EXPECT_FALSE(unit_meters("unknown"));
}

}  // namespace
}  // namespace rbvh
