// info and validate through the binary: what they report of pairs and scans, whole and damaged.
#include <nlohmann/json.hpp>

#include "io/rbvh_file.h"
#include "tests/format/pair_bytes.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

class Info : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(4));
    write_rbvh(path("a.rbvh"), make_small_rbvh(0), false);
  }
  Json json(const std::string& words) const {
    const ToolRun run = tool(words + " --json");
    EXPECT_EQ(run.code, 0) << run.err;
    return Json::parse(run.out, nullptr, false);
  }
  // Both stages refuse the file: exit 3 and one line that contains `part`.
  void expect_refused(const std::string& file, const std::string& part) const {
    for (const std::string stage : {"info", "validate"}) {
      const ToolRun run = tool(stage + " " + file);
      EXPECT_EQ(run.code, 3) << stage << ": " << run.err;
      EXPECT_EQ(run.lines(), 1) << run.err;
      EXPECT_EQ(run.err.find("rbvh " + stage + ": " + file), 0u) << run.err;
      EXPECT_NE(run.err.find(part), std::string::npos) << run.err;
      EXPECT_EQ(run.out, "");
    }
  }
};

TEST_F(Info, SaysWhatAPairHolds) {
  const Json pair = json("info a.rbvh");
  EXPECT_EQ(pair["kind"], "rbvh");
  EXPECT_EQ(pair["format"], "2.0");
  EXPECT_EQ(pair["bytes"],
            std::filesystem::file_size(path("a.rbvh")) + std::filesystem::file_size(path("a.atlas.tif")));
  EXPECT_EQ(pair["source"]["hash"], "1234567890abcdef");
  EXPECT_EQ(pair["source"]["kind"], "mesh");
  EXPECT_EQ(pair["source"]["shift"], Json({1e6, 2e6, 0}));
  EXPECT_EQ(pair["build_options"]["refinement"], "projected-area");
  ASSERT_EQ(pair["levels"].size(), 2u);
  const Json& level = pair["levels"][0];
  EXPECT_EQ(level["name"], "Q0");
  EXPECT_EQ(level["leaves"], 3);
  EXPECT_EQ(level["nodes"], 5);
  EXPECT_EQ(level["atlas"], Json({6, 5}));
  EXPECT_EQ(level["texels_used"], 29);
  EXPECT_EQ(level["alpha"].dump(), "0.85");
  EXPECT_EQ(level["layers"][2]["name"], "color");
  EXPECT_TRUE(level["fidelity"].is_null());
  EXPECT_EQ(pair["levels"][1]["fidelity"]["walls"], 3);
  const std::string text = tool("info a.rbvh").out;
  for (const char* part : {"format 2.0", "small.ply", "10 triangles", "\nQ1 ", "6 x 5", "3 walls"})
    EXPECT_NE(text.find(part), std::string::npos) << part << " in\n" << text;
}

TEST_F(Info, SaysWhatAScanHolds) {
  const Json mesh = json("info ball.ply");
  EXPECT_EQ(mesh["kind"], "mesh");
  EXPECT_EQ(mesh["vertices"], 40);
  EXPECT_EQ(mesh["triangles"], 48);
  EXPECT_GT(mesh["area"], 5.0);
  write("cloud.xyz", "1 2 3\n4 5 nan\n7 8 9\n");
  const Json cloud = json("info cloud.xyz");
  EXPECT_EQ(cloud["kind"], "cloud");
  EXPECT_EQ(cloud["non_finite"], 1);
  EXPECT_EQ(cloud["bounds"]["hi"], Json({7, 8, 9}));
  EXPECT_NE(tool("info - < ball.ply").out.find("48 triangles"), std::string::npos);
  EXPECT_NE(
      shell("mkfifo pipe && { cat ball.ply > pipe & '" RBVH_TOOL "' info pipe; }").out.find("48 triangles"),
      std::string::npos);
}

TEST_F(Info, TakesSeveralFiles) {
  for (const std::string stage : {"info", "validate"}) {
    EXPECT_EQ(tool(stage + " a.rbvh ball.ply").out,
              tool(stage + " a.rbvh").out + tool(stage + " ball.ply").out);
    const ToolRun run = tool(stage + " missing.ply ball.ply --json -q");
    EXPECT_EQ(run.code, 4) << run.err;
    EXPECT_EQ(run.lines(), 2) << run.err;
    EXPECT_TRUE(run.out.ends_with(tool(stage + " ball.ply --json").out)) << run.out;
  }
  bad("validate a.rbvh a.rbvh --against ball.ply", 2, "--against measures one file");
}

TEST_F(Info, ControlCharactersStayOutOfTheTerminal) {
  Rbvh rbvh = make_small_rbvh();
  rbvh.source.name = "\033[31mred\xff";
  write_rbvh(path("b.rbvh"), rbvh, false);
  EXPECT_EQ(tool("info b.rbvh").out.find('\033'), std::string::npos);
  EXPECT_EQ(json("info b.rbvh")["source"]["name"].get<std::string>().substr(0, 8), "\033[31mred");
}

TEST_F(Info, ValidateSaysThatAFileIsWhole) {
  const Json pair = json("validate a.rbvh");
  EXPECT_EQ(pair["valid"], true);
  EXPECT_EQ(pair["levels"], 2);
  EXPECT_EQ(pair["leaves"], 6);
  EXPECT_EQ(json("validate ball.ply")["triangles"], 48);
  EXPECT_NE(tool("validate a.rbvh").out.find("a.rbvh: whole"), std::string::npos);
  EXPECT_EQ(tool("validate ball.ply --against ball.ply").code, 2);
}

TEST_F(Info, DamageIsNamed) {
  expect_refused("missing.rbvh", "No such file");
  const Bytes whole = read_bytes(path("a.rbvh"));
  Bytes bytes = whole;
  bytes.pop_back();
  write_bytes(path("a.rbvh"), bytes);
  expect_refused("a.rbvh", "is cut");
  const ToolRun run = tool("validate a.rbvh --json");
  EXPECT_EQ(run.code, 3);
  EXPECT_EQ(Json::parse(run.out)["valid"], false);
  EXPECT_NE(Json::parse(run.out)["fault"].get<std::string>().find("is cut"), std::string::npos);

  bytes = whole;
  put<std::uint16_t>(bytes, find_seal(bytes).value() + 16, 3);
  reseal(bytes);
  write_bytes(path("a.rbvh"), bytes);
  expect_refused("a.rbvh", "newer than the 2.x");

  write_bytes(path("a.rbvh"), whole);
  std::filesystem::remove(path("a.atlas.tif"));
  expect_refused("a.rbvh", "without its atlas");
  write_rbvh(path("b.rbvh"), make_small_rbvh(1), false);
  std::filesystem::rename(path("b.atlas.tif"), path("a.atlas.tif"));
  const ToolRun wrong = tool("validate a.rbvh");
  EXPECT_EQ(wrong.code, 3);
  EXPECT_NE(wrong.err.find("a.atlas.tif: belongs to another pair than a.rbvh"), std::string::npos)
      << wrong.err;
}

TEST_F(Info, StandardOutputThatCannotBeWrittenIsAFailure) {
  for (const char* words : {"info a.rbvh", "validate a.rbvh --json"}) {
    const ToolRun run = tool(std::string(words) + " > /dev/full");
    EXPECT_EQ(run.code, 1) << words;
    EXPECT_EQ(run.lines(), 1) << run.err;
  }
}

TEST_F(Info, PairsThatCannotBeWrittenFailBeforeAnyWork) {
  const ToolRun full = tool("build ball.ply -o /dev/full -f");
  EXPECT_EQ(full.code, 1) << full.err;
  EXPECT_EQ(full.lines(), 1) << full.err;
  EXPECT_EQ(tool("build ball.ply -o ball.ply/below.rbvh").code, 1);
  EXPECT_EQ(tool("build ball.ply -o -").code, 2);
  EXPECT_EQ(tool("build ball.ply -o a.rbvh").code, 1);
  EXPECT_EQ(files(), "a.atlas.tif a.rbvh ball.ply");
}

}  // namespace
}  // namespace rbvh
