// What an Error holds: one line for people, its parts for programs.
#include "pipeline/base/error.h"

#include <gtest/gtest.h>

#include "cli/remedies.h"
#include "io/off.h"

namespace rbvh {
namespace {

TEST(Error, PutsFilePlaceAndMessageInOneLine) {
  const Error error(ErrorKind::kInput, "a.ply", {"line", 12}, "no number", Remedy::kOverwrite);
  EXPECT_STREQ(error.what(), "a.ply: line 12: no number");
  EXPECT_EQ(error.kind(), ErrorKind::kInput);
  EXPECT_EQ(error.file(), "a.ply");
  EXPECT_EQ(error.place().unit, "line");
  EXPECT_EQ(error.place().number, 12u);
  EXPECT_EQ(error.message(), "no number");
  EXPECT_EQ(error.remedy(), Remedy::kOverwrite);
}

TEST(Error, FileAndPlaceMayBeUnknown) {
  const Error error(ErrorKind::kBudget, "", "too much", Remedy::kMemoryBudget);
  EXPECT_STREQ(error.what(), "too much");
  EXPECT_EQ(error.place().unit, "");
  EXPECT_EQ(error.remedy(), Remedy::kMemoryBudget);
  EXPECT_STREQ(Error(ErrorKind::kInput, "a", "is cut").what(), "a: is cut");
  EXPECT_EQ(Error(ErrorKind::kInput, "a", "is cut").remedy(), Remedy::kNone);
}

TEST(Error, ReadersSayWhere) {
  try {
    read_off("OFF\n3 1 0\n0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n", "a.off");
    ADD_FAILURE() << "taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.file(), "a.off");
    EXPECT_EQ(error.place().unit, "line");
    EXPECT_EQ(error.place().number, 4u);
  }
}

TEST(Error, TheCommandLineNamesAnOptionForEveryRemedy) {
  const auto line = [](Remedy remedy) {
    return error_line(Error(ErrorKind::kFailure, "a", "is wrong", remedy));
  };
  EXPECT_EQ(line(Remedy::kNone), "a: is wrong");
  EXPECT_EQ(line(Remedy::kOverwrite), "a: is wrong; use --force to replace it");
  for (int i = 1; i <= static_cast<int>(Remedy::kNewLayer); ++i) {
    EXPECT_TRUE(line(static_cast<Remedy>(i)).starts_with("a: is wrong; ")) << i;
    EXPECT_NE(line(static_cast<Remedy>(i)).find("--"), std::string::npos) << i;
  }
}

}  // namespace
}  // namespace rbvh
