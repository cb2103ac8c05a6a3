// Points far from all others, and coordinates rounded to float.
#include "pipeline/scan/precision.h"

#include "tests/scan_bytes.h"

namespace rbvh {
namespace {

/// A grid of points a centimetre apart.
RawScan grid(Vec3d origin, std::size_t side = 40) {
  RawScan scan;
  for (std::size_t i = 0; i < side * side; ++i)
    scan.positions.push_back(origin + Vec3d{static_cast<double>(i % side) * 0.01,
                                            static_cast<double>(i / side) * 0.01,
                                            std::sin(0.1 * static_cast<double>(i)) * 0.01});
  return scan;
}

TEST(Precision, StrayPointsCostTheOthersNothing) {
  const Vec3d origin{458123.25, 5432871.5, 431.2};
  for (const Vec3d stray : {Vec3d{}, Vec3d{1e6, 0, 0}, Vec3d{-9999, -9999, -9999}, Vec3d{1e300, 0, 0}})
    for (const double side : {1.0, 2000.0}) {  // of 0.4 and 800
      RawScan raw = grid({}, 40);
      for (Vec3d& p : raw.positions) p = p * side + origin;
      const std::vector<Vec3d> wanted = raw.positions;
      for (int i = 0; i < 5; ++i) raw.positions.insert(raw.positions.begin() + 7 * i, stray);
      const Scan scan = shift_to_float(std::move(raw));
      double worst = 0;
      std::size_t found = 0;
      for (const Vec3f& p : scan.positions) {
        const Vec3d there = Vec3d(p) + scan.shift;
        if (!(length(there - origin) < 5000)) continue;
        worst = std::max(worst, length(there - wanted[found++]));
      }
      EXPECT_EQ(found, wanted.size());
      EXPECT_LT(worst, 1e-6 * side);
    }
}

TEST(Precision, ZerosMayBeMostPoints) {
  const RawScan near = grid({458123.25, 5432871.5, 431.2});
  RawScan raw = near;
  raw.positions.resize(4 * near.positions.size());
  EXPECT_EQ(count_far(raw.positions), 3 * near.positions.size());
  const Scan scan = shift_to_float(std::move(raw));
  for (std::size_t i = 0; i < near.positions.size(); ++i)
    EXPECT_LT(length(Vec3d(scan.positions[i]) + scan.shift - near.positions[i]), 1e-6);
}

TEST(Precision, FarPointsAreNamedAndRemoved) {
  RawScan scan = grid({458123, 5432871, 431});
  EXPECT_EQ(count_far(scan.positions), 0u);
  EXPECT_TRUE(precision_notes(scan).empty());
  scan.positions.push_back({});
  scan.positions.push_back({std::numeric_limits<double>::quiet_NaN(), 0, 0});
  EXPECT_EQ(count_far(scan.positions), 1u);
  ASSERT_EQ(precision_notes(scan).size(), 1u);
  EXPECT_EQ(precision_notes(scan)[0].find("1 point lies far from all the others, the first at 0 0 0"), 0u);
  EXPECT_EQ(drop_far(scan), 1u);
  EXPECT_EQ(count_far(scan.positions), 0u);
}

TEST(Precision, FloatsCoarserThanTheirSpacingAreNamed) {
  const auto rounded = [](RawScan scan) {
    for (Vec3d& p : scan.positions) p = Vec3d(Vec3f(p));
    return scan;
  };
  EXPECT_EQ(precision_notes(rounded(grid({458123, 5432871, 431}))).size(), 1u);
  EXPECT_TRUE(precision_notes(grid({458123.001, 5432871.002, 431})).empty());
  EXPECT_TRUE(precision_notes(rounded(grid({123, 871, 431}))).empty());
  RawScan whole;
  for (int i = 0; i < 900; ++i) whole.positions.push_back({4e7 + 4 * (i % 30), 4e7 + 4 * (i / 30), 0});
  EXPECT_TRUE(precision_notes(whole).empty());
}

}  // namespace
}  // namespace rbvh
