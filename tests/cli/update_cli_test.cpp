// rbvh update, through the binary.
#include "tests/cli/pair_tool_test.h"

namespace rbvh {
namespace {

class UpdateCli : public PairToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(24));
    good("build ball.ply -o a.rbvh --levels Q3,Q4");
  }
};

TEST_F(UpdateCli, ABoxIsReplacedInAllLevels) {
  const ToolRun run =
      tool("update a.rbvh --replace 0.2,-0.5,-0.5,2,0.5,0.5 --with ball.ply -o b.rbvh --report report.json");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("% of the surface went and"), std::string::npos) << run.err;
  const Json report = Json::parse(read("report.json"));
  ASSERT_EQ(report["levels"].size(), 2u);
  for (const Json& level : report["levels"]) {
    EXPECT_GT(level["removed"].get<int>() + level["cut"].get<int>(), 0);
    EXPECT_GT(level["added"], 0);
  }
  EXPECT_NEAR(report["change"]["removed"].get<double>(), report["change"]["added"].get<double>(), 0.01);
  EXPECT_GT(report["change"]["removed"], 0.01);
  const Json pair = info("b.rbvh");
  EXPECT_EQ(pair["build_options"]["updates"], 1);
  EXPECT_NEAR(pair["source"]["area"].get<double>(), info("a.rbvh")["source"]["area"].get<double>(), 0.05);
  const ToolRun check = tool("validate b.rbvh --against ball.ply --views 1");
  EXPECT_EQ(check.code, 0) << check.err;
  good("update b.rbvh --remove 0.2,-0.5,-0.5,2,0.5,0.5 -f");
  EXPECT_EQ(info("b.rbvh")["build_options"]["updates"], 2);
  good("update b.rbvh --add ball.ply -f");
  good("update b.rbvh --remove object:1 -o c.rbvh");
  good("update a.rbvh --replace object:0 --with ball.ply -o d.rbvh");
  good("validate c.rbvh d.rbvh");
  EXPECT_NE(tool("update --help").out.find("rbvh update site.rbvh --replace"), std::string::npos);
}

TEST_F(UpdateCli, TheSameWorkGivesTheSameBytes) {
  for (const std::string name : {"b", "c"})
    good("update a.rbvh --replace 0.2,-0.5,-0.5,2,0.5,0.5 --with ball.ply -o " + name + ".rbvh --threads " +
         (name == "b" ? "1" : "2"));
  EXPECT_EQ(read("b.rbvh"), read("c.rbvh"));
  EXPECT_EQ(read("b.atlas.tif"), read("c.atlas.tif"));
}

TEST_F(UpdateCli, ABoxIsInTheFilesCoordinates) {
  const std::string ball = ball_ply(24);
  const std::string header = ball.substr(0, ball.find("end_header\n") + 11);
  std::string moved = header;
  std::istringstream lines(ball.substr(header.size()));
  std::string line;
  while (std::getline(lines, line)) {
    double x = 0, y = 0, z = 0;
    char rest = 0;
    if (std::sscanf(line.c_str(), "%lf %lf %lf %c", &x, &y, &z, &rest) == 3) {
      char text[96];
      std::snprintf(text, sizeof text, "%.9f %.9f %.9f", x + 500000, y + 5000000, z);
      line = text;
    }
    moved += line + "\n";
  }
  std::string doubles = moved;
  for (std::size_t at; (at = doubles.find("property float")) != std::string::npos;)
    doubles.replace(at, 14, "property double");
  write("utm.ply", doubles);
  good("build utm.ply -o utm.rbvh --levels Q4");
  good("update utm.rbvh --replace 500000.2,4999999.5,-0.5,500002,5000000.5,0.5 --with utm.ply -o b.rbvh");
  EXPECT_EQ(info("b.rbvh")["source"]["shift"], info("utm.rbvh")["source"]["shift"]);
  bad("update utm.rbvh --remove 0.2,-0.5,-0.5,2,0.5,0.5 -o c.rbvh", 2, "500000");
}

TEST_F(UpdateCli, RefusalsAreALine) {
  bad("update a.rbvh -o b.rbvh", 2, "one change: ");
  bad("update a.rbvh --replace 0,0,0,1,1,1 -o b.rbvh", 2, "--with");
  bad("update a.rbvh --remove 0,0,0,1,1,1 --add ball.ply -o b.rbvh", 2, "one change: ");
  bad("update a.rbvh --remove 0,0,0,1,1 -o b.rbvh", 2, "--remove: '0,0,0,1,1' is not a box");
  bad("update a.rbvh --remove 0,0,0,1,1,0 -o b.rbvh", 2, "is not a box with a volume");
  bad("update a.rbvh --remove object:x -o b.rbvh", 2, "--remove");
  bad("update a.rbvh --remove 50,50,50,60,60,60 -o b.rbvh", 2, "a.rbvh: the box lies beside the pair");
  bad("update a.rbvh --remove -0.1,-0.1,-0.1,0.1,0.1,0.1 -o b.rbvh", 2, "nothing of the pair lies within");
  bad("update a.rbvh --remove object:7 -o b.rbvh", 2, "has no object 7");
  bad("update a.rbvh --remove 0,0,0,1,1,1", 1, "--force");
  bad("update a.rbvh --remove 0,0,0,1,1,1 -o b.ply", 2, "b.rbvh");
  bad("update ball.ply --remove 0,0,0,1,1,1 -o b.rbvh", 3, "is no .rbvh pair");
  bad("update a.rbvh --add gone.ply -o b.rbvh", 3, "gone.ply");
  bad("update a.rbvh --add a.rbvh -o b.rbvh", 3, "a.rbvh");
  good("build ball.ply -o parts.rbvh --levels Q4 --chunks 2");
  bad("update parts.rbvh --remove 0,0,0,1,1,1 -o b.rbvh", 3, "pair of parts");
}

}  // namespace
}  // namespace rbvh
