// rbvh batch: many scans, one chain; run again, cut, changed, failing.
#include <nlohmann/json.hpp>

#include "tests/run_tool.h"

namespace rbvh {
namespace {

using nlohmann::json;

class Batch : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    std::filesystem::create_directories(path("scans/more"));
    write("scans/a.ply", ball_ply(4));
    write("scans/b.ply", ball_ply(5));
    write("scans/more/a.ply", ball_ply(6));
    write("quick.json", R"({"steps": [{"stage": "ingest"}, {"stage": "info", "options": ["--json"]}]})");
  }
  json table(const std::string& name = "out/batch.json") const { return json::parse(read(name)); }
  std::string counts() const {
    const json counts = table()["counts"];
    return counts["done"].dump() + " " + counts["up_to_date"].dump() + " " + counts["failed"].dump();
  }
  int run(const std::string& words = "scans -o out --chain quick.json") const {
    return tool("batch " + words).code;
  }
};

TEST_F(Batch, MakesPairsAndPicturesOfAFolder) {
  const ToolRun run = tool("batch scans -o out --jobs 2");
  EXPECT_EQ(run.code, 0) << run.err;
  for (const char* name : {"a.ply", "a.rbvh", "a.atlas.tif", "a.png", "b.rbvh", "more/a.rbvh", "more/a.png"})
    EXPECT_TRUE(exists(std::string("out/") + name)) << name;
  EXPECT_EQ(counts(), "3 0 0");
  const json row = table()["scans"][0];
  EXPECT_EQ(row["name"], "a");
  EXPECT_EQ(row["state"], "done");
  EXPECT_EQ(row["levels"].size(), 5);
  EXPECT_GT(row["peak_bytes"], 1'000'000);
  EXPECT_EQ(row["bytes_in"], std::filesystem::file_size(path("scans/a.ply")));
  std::uintmax_t bytes = 0;
  for (const char* name : {"a.ply", "a.rbvh", "a.atlas.tif", "a.png"})
    if (exists(std::string("out/") + name))
      bytes += std::filesystem::file_size(path(std::string("out/") + name));
  EXPECT_EQ(row["bytes_out"], bytes);
  EXPECT_NE(read("out/batch.csv").find("name,source,state"), std::string::npos);
  // The bytes are those of the stages run by hand.
  good("build out/a.ply -o hand.rbvh");
  EXPECT_EQ(read("out/a.rbvh"), read("hand.rbvh"));
}

TEST_F(Batch, ASecondRunDoesNothingUntilSomethingChanges) {
  EXPECT_EQ(run(), 0);
  EXPECT_EQ(counts(), "3 0 0");
  const auto before = std::filesystem::last_write_time(path("out/a.ply"));
  EXPECT_EQ(run(), 0);
  EXPECT_EQ(counts(), "0 3 0");
  EXPECT_EQ(std::filesystem::last_write_time(path("out/a.ply")), before);
  shell("touch scans/*.ply out/*.ply");  // other times, the same content
  EXPECT_EQ(run(), 0);
  EXPECT_EQ(counts(), "0 3 0");
  write("scans/a.ply", ball_ply(7));  // a scan
  EXPECT_EQ(run(), 0);
  EXPECT_EQ(counts(), "1 2 0");
  std::filesystem::remove(path("out/b.ply"));  // an output
  EXPECT_EQ(run(), 0);
  EXPECT_EQ(counts(), "1 2 0");
  write("quick.json", R"({"steps": [{"stage": "ingest", "options": ["--units", "mm"]}, {"stage": "info"}]})");
  EXPECT_EQ(run(), 0);
  EXPECT_EQ(counts(), "3 0 0");
}

TEST_F(Batch, NamesWhatFailsAndDoesTheRest) {
  write("scans/bad.ply", "ply\nformat ascii 1.0\nelement vertex 3\n");
  write("scans/readme.md", "no scan");
  const ToolRun run = tool("batch scans -o out --chain quick.json --report report.json");
  EXPECT_EQ(run.code, 4);
  EXPECT_NE(run.err.find("bad.ply: ingest: "), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("1 file left out"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("1 of 4 scans failed"), std::string::npos) << run.err;
  EXPECT_EQ(counts(), "3 0 1");
  const json row = table()["scans"][2];
  EXPECT_EQ(row["name"], "bad");
  EXPECT_EQ(row["exit_code"], 3);
  EXPECT_EQ(row["step"], "ingest");
  EXPECT_EQ(json::parse(read("report.json"))["counts"], table()["counts"]);
  // Mended, it alone is done.
  write("scans/bad.ply", ball_ply(4));
  EXPECT_EQ(this->run(), 0);
  EXPECT_EQ(counts(), "1 3 0");
}

TEST_F(Batch, ReportsAreWrittenWhereAStageFails) {
  write("bad.ply", "ply\n");
  EXPECT_EQ(tool("ingest bad.ply -o x.ply --report r.json").code, 3);
  const json report = json::parse(read("r.json"));
  EXPECT_EQ(report["exit_code"], 3);
  EXPECT_NE(report["error"].get<std::string>().find("bad.ply"), std::string::npos);
}

TEST_F(Batch, GoesOnWhereItWasKilled) {
  shell("timeout -s KILL 0.3 '" RBVH_TOOL "' batch scans -o out --jobs 1");
  ASSERT_EQ(tool("batch scans -o out").code, 0);
  ASSERT_EQ(tool("batch scans -o whole").code, 0);
  for (const char* name : {"a.rbvh", "b.rbvh", "more/a.rbvh", "a.png"})
    EXPECT_EQ(read(std::string("out/") + name), read(std::string("whole/") + name)) << name;
}

TEST_F(Batch, ReplacesOnlyWhatItWrote) {
  std::filesystem::create_directories(path("out"));
  write("out/a.ply", "mine");
  const ToolRun run = tool("batch scans -o out --chain quick.json");
  EXPECT_EQ(run.code, 4);
  EXPECT_NE(run.err.find("out/a.ply: exists, and this batch has not written it; use --force"),
            std::string::npos)
      << run.err;
  EXPECT_EQ(read("out/a.ply"), "mine");
  EXPECT_EQ(this->run("scans -o out --chain quick.json -f"), 0);
  EXPECT_NE(read("out/a.ply"), "mine");
  write("out/a.ply", "edited");
  write("scans/a.ply", ball_ply(8));
  EXPECT_EQ(this->run(), 4);
  EXPECT_EQ(read("out/a.ply"), "edited");
}

TEST_F(Batch, NoTwoOutputsAreOneFile) {
  write("scans/a-lod.ply", ball_ply(4));
  write("lod.json", R"({"steps": [{"stage": "build"}, {"stage": "lod", "options": ["--levels", "Q4"]}]})");
  bad("batch scans -o out --chain lod.json -f", 2, "a-lod.rbvh, which is of ");
  bad("batch scans -o scans --chain quick.json -f", 2, "a.ply, which is the scan");
}

TEST_F(Batch, TexturedScansAreReadAgain) {  // their images may have changed
  std::filesystem::create_directory(path("textured"));
  const std::string tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  write("textured/a.obj", "mtllib a.mtl\n" + tetrahedron);
  write("textured/b.obj", tetrahedron);
  write("ingest.json", R"({"steps": [{"stage": "ingest"}]})");
  EXPECT_EQ(run("textured -o out --chain ingest.json"), 0);
  EXPECT_EQ(run("textured -o out --chain ingest.json"), 0);
  EXPECT_EQ(counts(), "1 1 0");
}

TEST_F(Batch, FilesThatOptionsNameAreWatched) {
  write("sky.json", R"({"cameras": [{"azimuth_angle": 10}]})");
  write("picture.json", R"({"steps": [{"stage": "render", "options": ["--cameras=sky.json", "--quick",
    "--resolution", "16,16"]}]})");
  EXPECT_EQ(run("scans -o out --chain picture.json"), 0);
  EXPECT_EQ(run("scans -o out --chain picture.json"), 0);
  EXPECT_EQ(counts(), "0 3 0");
  write("sky.json", R"({"cameras": [{"azimuth_angle": 90}]})");
  EXPECT_EQ(run("scans -o out --chain picture.json"), 0);
  EXPECT_EQ(counts(), "3 0 0");
}

TEST_F(Batch, ShardsAreTheWhole) {
  EXPECT_EQ(run("scans -o out --chain quick.json --shard 1/2"), 0);
  EXPECT_EQ(table("out/batch-1-of-2.json")["counts"]["scans"], 2);
  EXPECT_EQ(run("scans -o out --chain quick.json --shard 2/2"), 0);
  EXPECT_EQ(table("out/batch-2-of-2.json")["counts"]["scans"], 1);
  EXPECT_EQ(run(), 0);
  EXPECT_EQ(counts(), "0 3 0");
}

TEST_F(Batch, AScanThatNeedsMoreMemoryRunsAlone) {
  // Each of the two has half of it, which is not enough for the picture; all of it is.
  EXPECT_EQ(tool("render scans/a.ply -o a.png --quick --memory 150M").code, 5);
  write("picture.json", R"({"steps": [{"stage": "render", "options": ["--quick"]}]})");
  const ToolRun run =
      tool("batch scans/a.ply scans/b.ply -o out --chain picture.json --jobs 2 --memory 300M");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(this->run("scans/a.ply scans/b.ply -o none --chain picture.json --jobs 1 --memory 50M"), 4);
}

TEST_F(Batch, ScansThatDifferByTheirExtensionKeepIt) {
  write("scans/b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(run(), 0);
  EXPECT_TRUE(exists("out/b.obj.ply"));
  EXPECT_TRUE(exists("out/b.ply.ply"));
  EXPECT_TRUE(exists("out/a.ply"));
}

TEST_F(Batch, ManifestsAreChecked) {
  const auto refused = [&](const std::string& manifest, const std::string& part, int code = 3) {
    write("wrong.json", manifest);
    const ToolRun run = tool("batch scans -o out --chain wrong.json");
    EXPECT_EQ(run.code, code) << manifest << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
    EXPECT_NE(run.err.find(part), std::string::npos) << run.err;
    EXPECT_FALSE(exists("out"));
  };
  refused("[]", "is no manifest");
  refused("{", "is no manifest");
  refused(R"({"step": []})", "\"step\" is no key");
  refused(R"({"steps": []})", "no list with a step");
  refused(R"({"steps": [{"stage": "rm"}]})", "'rm' is no stage for batches");
  refused(R"({"steps": [{"stage": "ingest", "options": "--units mm"}]})", "\"options\" is no list");
  refused(R"({"steps": [{"stage": "ingest", "output": "../{name}.ply"}]})",
          "no name within the output folder");
  refused(R"({"steps": [{"stage": "ingest", "output": "a.ply"}]})", "lacks {name}");
  refused(R"({"steps": [{"stage": "render", "input": "{build}"}]})", "nothing before it is {build}");
  refused(R"({"steps": [{"stage": "render"}, {"stage": "render"}]})", "two steps are called 'render'");
  refused(R"({"steps": [{"stage": "render"}, {"stage": "render", "name": "b"}]})",
          "two steps write {name}.png");
  refused(R"({"steps": [{"stage": "build", "options": ["-o", "x"]}]})", "-o is what the batch itself gives");
  refused(R"({"steps": [{"stage": "ingest", "name": "../up"}]})", "'../up' is no name of a step");
  refused(R"({"steps": [{"stage": "ingest", "name": "source"}]})", "'source' is no name of a step");
  bad("batch -o out", 2, "which scans?");
  bad("batch scans -o out --chain ''", 2, "--chain");
  std::filesystem::create_directories(path("empty"));
  bad("batch empty -o out", 3, "no scan is there");
  bad("batch nowhere -o out2", 3, "no such file or folder");
}

TEST_F(Batch, InputsMayStandInTheManifest) {
  write("scans/all.json", R"({"inputs": ["*.ply", "more"], "steps": [{"stage": "ingest"},
    {"stage": "render", "name": "two", "output": "{name}-{level}.png", "options": ["--resolution", "16,16"]}]})");
  EXPECT_EQ(run("-o out --chain scans/all.json"), 2);  // more/a.ply and a.ply would both be "a"
  write("scans/all.json", R"({"inputs": ["."], "steps": [{"stage": "ingest"},
    {"stage": "render", "name": "two", "output": "{name}-{level}.png", "options": ["--resolution", "16,16"]}]})");
  EXPECT_EQ(run("-o out --chain scans/all.json"), 0);
  EXPECT_TRUE(exists("out/a-exact.png"));
  EXPECT_TRUE(exists("out/more/a-exact.png"));
}

}  // namespace
}  // namespace rbvh
