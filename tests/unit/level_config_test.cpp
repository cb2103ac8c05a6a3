// Levels of any error: between the standard ones, beyond them, and in whatever order they are wanted.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "pipeline/base/error.h"
#include "rbvh/build.h"
#include "tests/usage_refusal.h"

namespace rbvh {
namespace {

TEST(LevelConfig, AStandardErrorGivesTheStandardLevel) {
  for (const LevelConfig& level : standard_levels()) {
    const LevelConfig own = level_of_error(static_cast<double>(level.error));
    EXPECT_EQ(own.name, level.name);
    EXPECT_EQ(own.rho, level.rho);
    EXPECT_EQ(own.alpha, level.alpha);
    EXPECT_EQ(own.phi_degrees, level.phi_degrees);
    EXPECT_EQ(own.error, level.error);
  }
}

TEST(LevelConfig, BetweenTwoStandardLevelsTheOthersFollowFromTheErrorsLogarithm) {
  const LevelConfig &q3 = standard_levels()[3], &q4 = standard_levels()[4];
  const double middle = std::sqrt(static_cast<double>(q3.error) * static_cast<double>(q4.error));
  const LevelConfig own = level_of_error(middle);
  EXPECT_NEAR(own.rho, std::sqrt(q3.rho * q4.rho), 1e-4f * own.rho);
  EXPECT_NEAR(own.alpha, (q3.alpha + q4.alpha) / 2, 1e-5f);
  EXPECT_NEAR(own.phi_degrees, (q3.phi_degrees + q4.phi_degrees) / 2, 1e-3f);
  EXPECT_EQ(own.error, static_cast<float>(middle));
}

TEST(LevelConfig, BeyondTheStandardLevelsRhoGoesOnAsOneOverTheError) {
  const LevelConfig &q0 = standard_levels().front(), &q4 = standard_levels().back();
  const LevelConfig fine = level_of_error(static_cast<double>(q0.error) / 4);
  EXPECT_NEAR(fine.rho, 4 * q0.rho, 1);
  EXPECT_EQ(fine.alpha, q0.alpha);
  EXPECT_EQ(fine.phi_degrees, q0.phi_degrees);
  EXPECT_EQ(fine.name, "Q0");
  const LevelConfig coarse = level_of_error(10 * static_cast<double>(q4.error));
  EXPECT_NEAR(coarse.rho, q4.rho / 10, 1);
  EXPECT_EQ(coarse.alpha, q4.alpha);
  EXPECT_EQ(coarse.name, "Q4");
  EXPECT_NEAR(level_of_error(kFinestError).rho, 32e6f, 10);
  EXPECT_NEAR(level_of_error(kCoarsestError).rho, 192.0f, 0.1f);
}

TEST(LevelConfig, RhoFallsAllTheWay) {
  float before = std::numeric_limits<float>::infinity();
  for (double error = kFinestError; error < kCoarsestError; error *= 1.1) {
    const float rho = level_of_error(error).rho;
    EXPECT_LT(rho, before) << error;
    before = rho;
  }
}

TEST(LevelConfig, TheNameIsTheNearestOnes) {
  EXPECT_EQ(level_of_error(2.2e-5).name, "Q0");  // the middle of Q0 and Q1 is 2.263e-5
  EXPECT_EQ(level_of_error(2.3e-5).name, "Q1");
  EXPECT_EQ(level_of_error(3.1e-4).name, "Q3");  // 3.194e-4
  EXPECT_EQ(level_of_error(3.5e-4).name, "Q4");
}

TEST(LevelConfig, ErrorsThatNoFloatHoldsAndThoseThatLeaveNothingAreRefused) {
  for (const double error : {0.9e-6, 0.0, -1.0, 0.11, std::nan(""), double{INFINITY}})
    EXPECT_NE(usage_refusal([&] { level_of_error(error); }).find("is not between 1e-06 and 0.1"),
              std::string::npos);
}

TEST(LevelConfig, WantedLevelsAreFinestFirst) {
  EXPECT_EQ(wanted_levels({}).size(), 5u);
  const std::vector<LevelConfig> levels = wanted_levels({{"Q4", 5e-4}, {"Q2", {}}, {"Q0", 1e-5}, {"Q2", {}}});
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0].name, "Q0");
  EXPECT_EQ(levels[0].error, 1e-5f);
  EXPECT_EQ(levels[0].rho, level_of_error(1e-5).rho);
  EXPECT_EQ(levels[1].error, standard_levels()[2].error);
  EXPECT_EQ(levels[1].rho, standard_levels()[2].rho);
  EXPECT_EQ(levels[2].name, "Q4");
  EXPECT_EQ(levels[2].error, 5e-4f);
  // The name is the one that was asked for, whatever is nearest.
  EXPECT_EQ(wanted_levels({{"Q4", 2e-5}})[0].name, "Q4");
}

TEST(LevelConfig, WantedLevelsThatContradictEachOtherAreRefused) {
  const auto of = [](std::vector<WantedLevel> wanted) {
    return usage_refusal([&] { wanted_levels(wanted); });
  };
  EXPECT_NE(of({{"Q5", 1e-4}}).find("there is no level 'Q5'"), std::string::npos);
  EXPECT_NE(of({{"Q1", 1e-4}, {"Q1", 2e-4}}).find("level Q1 is wanted with two errors"), std::string::npos);
  EXPECT_NE(of({{"Q1", {}}, {"Q1", 2e-4}}).find("level Q1 is wanted with two errors"), std::string::npos);
  EXPECT_NE(of({{"Q2", {}}, {"Q0", 1e-4}})
                .find("level Q2's error, 5.8e-05, is not coarser than level Q0's, 0.0001"),
            std::string::npos);
  EXPECT_NE(of({{"Q2", 1e-4}, {"Q0", 1e-4}}).find("is not coarser"), std::string::npos);
  EXPECT_NE(of({{"Q2", 1e-7}}).find("is not between"), std::string::npos);
}

}  // namespace
}  // namespace rbvh
