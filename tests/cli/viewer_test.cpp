// rbvh view: which levels a page holds, its size, and that names in it are text. What the page does in a
// browser is tested in tests/browser.
#include <gtest/gtest.h>

#include "tests/run_tool.h"

namespace rbvh {
namespace {

class ViewStage : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(24));
    good("build ball.ply --levels Q1,Q3 -o ball.rbvh");
  }
  std::size_t levels_in(const std::string& name) const {
    const std::string page = read(name);
    std::size_t count = 0;
    while (page.find("id=\"rbvh-level-" + std::to_string(count) + "\"") != std::string::npos) ++count;
    return count;
  }
};

TEST_F(ViewStage, APageHoldsAllLevelsOrThoseThatAreNamed) {
  good("view ball.rbvh -o all.html");
  EXPECT_EQ(levels_in("all.html"), 2u);
  good("view ball.rbvh --level Q3 -o one.html");
  EXPECT_EQ(levels_in("one.html"), 1u);
  EXPECT_LT(read("one.html").size(), read("all.html").size());
  EXPECT_NE(read("one.html").find("\"name\":\"Q3\""), std::string::npos);
  for (const char* place : {"@TITLE@", "@META@", "@FIRST@", "@REST@", "@THUMBNAIL@"})
    EXPECT_EQ(read("all.html").find(place), std::string::npos) << place;
  bad("view ball.rbvh --level Q9 -o no.html", 2, "Q9");
  bad("view ball.ply -o no.html", 3, "is no .rbvh pair");
}

TEST_F(ViewStage, ASizeLimitKeepsTheFinestLevelsThatFit) {
  good("view ball.rbvh -o all.html");
  const std::size_t whole = read("all.html").size();
  good("view ball.rbvh --max-bytes " + std::to_string(whole) + " -o same.html");
  EXPECT_TRUE(read("same.html") == read("all.html"));
  good("view ball.rbvh --max-bytes " + std::to_string(whole - 1) + " -o less.html");
  EXPECT_EQ(levels_in("less.html"), 1u);
  EXPECT_NE(read("less.html").find("\"name\":\"Q1\""), std::string::npos);
  bad("view ball.rbvh --max-bytes 1000 -o none.html", 5, "no level fits");
}

TEST_F(ViewStage, AThumbnailIsInThePageBeforeItsScript) {
  good("view ball.rbvh --thumbnail -o still.html");
  const std::string page = read("still.html");
  const std::size_t picture = page.find("<img id=\"still\""), script = page.find("<script");
  ASSERT_NE(picture, std::string::npos);
  EXPECT_LT(picture, script);
  good("view ball.rbvh -o plain.html");
  EXPECT_EQ(read("plain.html").find("<img"), std::string::npos);
}

TEST_F(ViewStage, NamesAreText) {
  const std::string name = "</script><script>alert(1)</script>&";
  std::string flat = name;
  std::replace(flat.begin(), flat.end(), '/', '_');  // no name of a file has one
  good("build ball.ply --levels Q3 -o '" + flat + ".rbvh'");
  good("view '" + flat + ".rbvh' -o page.html");
  const std::string page = read("page.html");
  EXPECT_EQ(page.find(flat), std::string::npos);
  EXPECT_EQ(page.find("<script>alert"), std::string::npos);
  EXPECT_NE(page.find("&lt;script&gt;alert(1)"), std::string::npos);
  EXPECT_NE(page.find("\\u003cscript>alert(1)"), std::string::npos);
  good("view '" + flat + ".rbvh' -o again.html");
  EXPECT_TRUE(read("again.html") == page);
}

}  // namespace
}  // namespace rbvh
