// The command line's options: what is refused, how, and that nothing is left behind.
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/npy.h"
#include "pipeline/bvh/exact_methods.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

class Usage : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("a.ply", ball_ply(4));
  }
  // A wrong option: exit 2, one line, which contains `part`, and nothing written.
  void expect_usage_error(const std::string& words, const std::string& part) {
    const ToolRun run = tool(words);
    EXPECT_EQ(run.code, 2) << words << "\n" << run.err;
    EXPECT_EQ(run.lines(), 1) << words << "\n" << run.err;
    EXPECT_NE(run.err.find(part), std::string::npos) << words << "\n" << run.err;
    EXPECT_EQ(run.out, "") << words;
    EXPECT_EQ(files(), "a.ply") << words;
  }
};

TEST_F(Usage, TheStageComesFirst) {
  expect_usage_error("", "which stage?");
  expect_usage_error("rendr a.ply -o a.png", "'rendr' is no stage");
  expect_usage_error("-q render a.ply -o a.png", "options follow the stage's name");
  expect_usage_error("devices devices", "devices");
  expect_usage_error("help rendr", "'rendr' is no stage");
  EXPECT_EQ(tool("help").out, tool("--help").out);
  EXPECT_EQ(tool("help build").out, tool("build --help").out);
}

TEST_F(Usage, NoPathIsBothReadAndWritten) {
  expect_usage_error("build a.ply -o a.ply -f", "a.ply: is named twice");
  expect_usage_error("build a.ply -o b.rbvh --report ./a.ply -f", "is named twice");
  expect_usage_error("build a.ply -o b.rbvh --report b.rbvh", "is named twice");
  expect_usage_error("build a.ply -o b.rbvh --report b.atlas.tif", "is named twice");
  expect_usage_error("trace a.ply --rays r.npy -o a.ply -f", "is named twice");
  expect_usage_error("proxy a.ply -o a.obj --report a.vdm.exr", "is named twice");
  expect_usage_error("render a.ply -o a.png --report a.ply -f", "is named twice");
  expect_usage_error("ingest a.ply -o b.ply --report a.ply -f", "is named twice");
  expect_usage_error("ingest a.ply -o a.ply -f", "is named twice");
}

TEST_F(Usage, ErrorsNameTheStageAndTheOption) {
  expect_usage_error("render a.ply", "rbvh render: ");
  expect_usage_error("render a.ply -o a.png --resolution 64", "--resolution: '64'");
  expect_usage_error("render a.ply -o a.png --resolution 64,0", "--resolution");
  expect_usage_error("render a.ply -o a.png --camera-position 0,1,,2", "--camera-position: '0,1,,2'");
  expect_usage_error("render a.ply -o a.png --camera-position nan,1,2", "--camera-position");
  expect_usage_error("render a.ply -o a.png --camera-view-angle 30deg", "--camera-view-angle");
  expect_usage_error("render a.ply -o a.png --up W", "--up");
  expect_usage_error("render a.ply -o a.png --threads 0", "--threads");
  expect_usage_error("render a.ply -o a.png --memory lots", "--memory");
  expect_usage_error("render a.ply -o a.png --progress loud", "--progress");
  expect_usage_error("render a.ply -o a.png --aov colour", "--aov");
  expect_usage_error("render a.ply -o a.png --samples 2000000", "--samples");
  expect_usage_error("render a.ply -o a.png --turntable -3 ", "--turntable");
  expect_usage_error("render a.ply -o a.png --turntable 100001", "--turntable");
  expect_usage_error("render a.ply -o a.png --no-such-option", "--no-such-option");
  expect_usage_error("render a.ply --outptu a.png", "'--outptu' is no option; see rbvh render --help");
  expect_usage_error("info -a.ply", "follows --");
  expect_usage_error("render a.ply -o a.png -o b.png", "-o");
  for (const char* name : {"a.png", "{level}.png", "{name}-{level}.png"})
    expect_usage_error(std::string("render a.ply -o '") + name + "' --level Q3 Q4",
                       "Q4: is no file; levels have commas");
  expect_usage_error("build a.ply -o b.rbvh --levels Q0,Q9", "Q9");
  expect_usage_error("build a.ply -o b.rbvh --levels Q0,,Q1", "--levels");
  expect_usage_error("build a.ply -o b.rbvh --refinement best", "--refinement");
  expect_usage_error("build a.ply -o b.rbvh --hybrid maybe", "--hybrid");
  expect_usage_error("trace a.ply extra.ply --rays r.npy -o b.npy", "extra.ply");
  expect_usage_error("build a.ply b.ply -o {name}.rbvh", "rbvh batch");
  expect_usage_error("trace a.ply -o h.npy", "--rays");
  expect_usage_error("render a.ply -o a.png --tracer best", "wide16");
  expect_usage_error("render a.ply -o a.png --builder best", "sah-binned");
  expect_usage_error("render a.ply -o a.png --compare wide16", "--compare");
  expect_usage_error("render a.ply -o a.png --compare wide16,bvh-stack --aov depth", "--aov");
  expect_usage_error("render a.ply -o a.png --tracer bvh-stack --builder kd", "kd");
  expect_usage_error("trace a.ply --rays r.npy -o h.npy --level Q0,Q1", "--level");
  expect_usage_error("render a.ply -o a.png --level ''", "--level: ''");
  expect_usage_error("trace - --rays - -o h.npy < a.ply", "standard input");
  expect_usage_error("paint a.rbvh --layer w --points - --values - -f < a.ply", "standard input");
  expect_usage_error("ingest a.ply -o b.ply --normals-k 5", "--normals-k is for clouds");
}

TEST_F(Usage, PictureNamesAreCheckedBeforeAnyWork) {
  expect_usage_error("render a.ply -o a.bmp", "a.bmp");
  expect_usage_error("render a.ply -o a", ".png");
  expect_usage_error("render a.ply -o a.png --aov depth", ".exr");
  expect_usage_error("render a.ply -o a.jpg --aov position", ".exr");
  expect_usage_error("render a.ply -o '{file}.png'", "{name}");
  expect_usage_error("render a.ply b.ply -o a.png", "{name}");
  expect_usage_error("render a.ply x/a.ply -o '{name}.png'", "x/a.ply");
  expect_usage_error("render a.ply -o a.png --turntable 3", "{frame}");
  expect_usage_error("render a.ply -o a.png --level all", "{level}");
}

TEST_F(Usage, CamerasThatSeeNothingAreRefused) {
  expect_usage_error("render a.ply -o a.png --camera-position 1,2,3 --camera-focal-point 1,2,3",
                     "focal point");
  expect_usage_error("render a.ply -o a.png --camera-position 0,9,0 --camera-focal-point 0,0,0", "view up");
  expect_usage_error("render a.ply -o a.png --camera-view-angle 180", "view angle");
  expect_usage_error("render a.ply -o a.png --camera-view-up 0,0,0", "view up");
  expect_usage_error("render a.ply -o a.png --camera-position 1e300,0,0", "too far");
  expect_usage_error("render a.ply -o a.png --camera-focal-point 0,-1e300,0", "too far");
}

TEST_F(Usage, HelpAndVersionGoToStdout) {
  const std::string version = tool("--version").out;
  EXPECT_EQ(version.substr(0, 5), "rbvh ");
  EXPECT_NE(version.find("PCL 1."), std::string::npos) << version;
  EXPECT_EQ(version.find(" ,"), std::string::npos) << "a library without a version: " << version;
  EXPECT_NE(tool("--help").out.find("Example:"), std::string::npos);
  for (const char* stage : {"build", "proxy", "render", "trace", "info", "validate", "devices"}) {
    const ToolRun run = tool(std::string(stage) + " --help");
    EXPECT_EQ(run.code, 0) << stage;
    EXPECT_EQ(run.err, "") << stage;
    EXPECT_NE(run.out.find("Example: rbvh " + std::string(stage)), std::string::npos) << stage;
    EXPECT_NE(run.out.find("--quiet"), std::string::npos) << stage;
    EXPECT_NE(tool("--help").out.find(stage), std::string::npos);
  }
}

TEST_F(Usage, ProgressAsJsonIsNothingElse) {
  const ToolRun run = tool("render a.ply -o a.png --resolution 8,8 --progress json -v");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(tool("ingest a.ply -o a.ply/b.ply --progress json").lines(), 1);
  std::istringstream lines(run.err + tool("build a.ply -o no/b.rbvh --progress json").err);
  int said = 0, phases = 0;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json json = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_object()) << line;
    said += json.contains("line");
    phases += json.contains("phase");
  }
  EXPECT_GT(said, 0);
  EXPECT_GT(phases, 0);
}

// Of what else comes through the pipe nobody waits.
TEST_F(Usage, ATraceThatFailsDoesNotWaitForItsRays) {
  constexpr int kRays = 600'000, kFirst = 400'000;
  std::vector<float> rays(std::size_t{kFirst} * 6, 1.f);
  write_npy(path("rays.npy"), rays, 6, false);
  std::string bytes = read("rays.npy");
  const std::size_t rows = bytes.find(std::to_string(kFirst));
  ASSERT_NE(rows, std::string::npos);
  write("rays.npy", bytes.replace(rows, 6, std::to_string(kRays)));
  const ToolRun run = shell(
      "mkfifo pipe; { cat rays.npy; exec sleep 60; } > pipe & timeout 30 prlimit --fsize=5000000: '" RBVH_TOOL
      "' trace a.ply --rays - -o h.npy -q < pipe; code=$?; kill $!; exit $code");
  EXPECT_EQ(run.code, 1) << run.err;
  EXPECT_NE(run.err.find("h.npy"), std::string::npos) << run.err;
}

TEST_F(Usage, DevicesAreListed) {
  const nlohmann::json devices = nlohmann::json::parse(tool("devices --json").out, nullptr, false);
  ASSERT_FALSE(devices.empty());
  const std::string name = devices[0]["name"];
  EXPECT_EQ(devices[0]["index"], 0);
  EXPECT_NE(tool("devices").out.find(name), std::string::npos);
  // As a terminal has it; script(1) makes one. No colour where none is wanted.
  const std::string wrong = "script -qec \"'" RBVH_TOOL "' render missing.ply -o x.png";
  EXPECT_NE(shell(wrong + "\" /dev/null").out.find("\033[31m"), std::string::npos);
  EXPECT_EQ(shell(wrong + " --no-color\" /dev/null").out.find('\033'), std::string::npos);
  EXPECT_EQ(shell("NO_COLOR=1 " + wrong + "\" /dev/null").out.find('\033'), std::string::npos);
}

TEST_F(Usage, TracersAreListed) {
  for (const char* words : {"render --tracer list", "trace --tracer list"}) {
    const ToolRun run = tool(words);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_EQ(run.err, "");
    for (const ExactTraversalInfo& t : kExactTraversals) {
      const std::string line = "\n" + std::string(t.name) + " ";
      EXPECT_NE(("\n" + run.out).find(line), std::string::npos) << t.name;
    }
    EXPECT_EQ(std::count(run.out.begin(), run.out.end(), '\n'), std::ptrdiff_t{std::size(kExactTraversals)});
  }
}

TEST_F(Usage, TracersAreForWhatTheyFit) {
  write("cloud.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0.5 0.5 0\n");
  for (const char* words : {"render cloud.xyz -o a.png --tracer bvh-stack",
                            "render cloud.xyz -o a.png --compare wide16,bvh-stack"}) {
    const ToolRun run = tool(words);
    EXPECT_EQ(run.code, 2) << words << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
    EXPECT_NE(run.err.find("cloud.xyz"), std::string::npos) << run.err;
  }
}

TEST_F(Usage, RemediesNameTheirOptions) {
  write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  good("ingest a.obj -o b.ply");
  EXPECT_NE(tool("ingest a.obj -o b.ply").err.find("b.ply: exists already; use --force"), std::string::npos);
  const ToolRun along =
      tool("render a.ply -o a.png --camera-position 0,5,0 --camera-focal-point 0,0,0 --camera-view-up 0,1,0");
  EXPECT_EQ(along.code, 2);
  EXPECT_NE(along.err.find("give another --camera-view-up"), std::string::npos) << along.err;
}

// As Mesa's llvmpipe does.
TEST_F(Usage, ADeviceWhoseLoopsEndEarlyIsRefused) {
  std::filesystem::create_directories(path("kernels/common"));
  std::ifstream original(RBVH_SOURCE "/kernels/common/check_loops.cl");
  std::string text{std::istreambuf_iterator<char>(original), {}};
  const std::size_t at = text.find("++done)");
  ASSERT_NE(at, std::string::npos);
  write("kernels/common/check_loops.cl", text.insert(at + 7, " if (done == 65535) break; else"));
  write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const ToolRun run = tool("render a.obj -o a.png -q", "RBVH_KERNELS='" + path("kernels") + "'");
  EXPECT_EQ(run.code, 6);
  EXPECT_EQ(run.lines(), 1) << run.err;
  EXPECT_NE(run.err.find("after 65535 of 200000 iterations"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("another device"), std::string::npos) << run.err;
  EXPECT_FALSE(exists("a.png"));
}

TEST_F(Usage, LostOutputIsAFailure) {
  EXPECT_EQ(shell("'" RBVH_TOOL "' --help > /dev/full").code, 1);
  EXPECT_EQ(shell("'" RBVH_TOOL "' --help >&-").code, 1);
  EXPECT_EQ(shell("'" RBVH_TOOL "' --help 2>&1 >&- | grep -c 'standard output'").out, "1\n");
  const ToolRun gone = shell("{ sleep 0.3; '" RBVH_TOOL "' --help; echo code $? >&2; } | true");
  EXPECT_NE(gone.err.find("code 1"), std::string::npos) << "a reader that has gone: " << gone.err;
}

TEST_F(Usage, InputsAreCheckedBeforeADeviceIsOpened) {
  for (const char* words : {"render missing.ply -o a.png", "build missing.ply -o a.rbvh",
                            "trace missing.ply --rays missing.npy -o h.npy"}) {
    const ToolRun run = tool(std::string(words) + " --device no-such-device");
    EXPECT_EQ(run.code, 3) << words << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
    EXPECT_NE(run.err.find("missing."), std::string::npos) << run.err;
  }
  const ToolRun run = tool("render a.ply -o a.png --device no-such-device");
  EXPECT_EQ(run.code, 6) << run.err;
  EXPECT_EQ(run.lines(), 1) << run.err;
  EXPECT_EQ(files(), "a.ply");
}

TEST_F(Usage, OutputsThatCannotBeWrittenAreFoundBeforeTheWork) {
  write("there.png", "mine");
  const ToolRun there = tool("render a.ply -o there.png --device no-such-device");
  EXPECT_EQ(there.code, 1) << there.err;
  EXPECT_EQ(there.lines(), 1) << there.err;
  EXPECT_EQ(read("there.png"), "mine");
  EXPECT_EQ(tool("render a.ply -o a.ply/x.png").code, 1);
  EXPECT_EQ(tool("render a.ply -o nowhere/x.png").code, 1);
  EXPECT_EQ(tool("build a.ply -o nowhere/x.rbvh").code, 1);
  EXPECT_EQ(tool("render a.ply -o x.png --report nowhere/r.json").code, 1);
  EXPECT_EQ(files(), "a.ply there.png");
}

TEST_F(Usage, BudgetsAreKept) {
  for (const char* words : {"render a.ply -o a.png --memory 1K", "build a.ply -o a.rbvh --memory 1M",
                            "render a.ply -o a.png --memory 100M --resolution 20000,20000"}) {
    const ToolRun run = tool(words);
    EXPECT_EQ(run.code, 5) << words << run.err;
    EXPECT_EQ(run.lines(), 1) << run.err;
  }
  EXPECT_EQ(files(), "a.ply");
  // The files fit; what is made of them does not.
  write_npy(path("r.npy"), std::vector<float>{0, 0, 4, 0, 0, -1}, 6, false);
  write("plate.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_EQ(tool("build plate.ply -o p.rbvh --levels Q1 --hybrid off -q").code, 0);
  for (const auto& [words, part] :
       {std::pair{"trace a.ply --rays r.npy -o h.npy --memory 9K",
                  "a.ply: its hierarchy needs about 10.6 kB"},
        std::pair{"info a.ply --memory 1K", "a.ply: reading it"},
        std::pair{"validate a.ply --memory 1K", "a.ply: reading it"},
        std::pair{"info p.rbvh --memory 2M", "p.rbvh: reading it"},
        std::pair{"trace p.rbvh --rays r.npy -o h.npy --memory 2M", "p.rbvh: reading it"},
        std::pair{"sample p.rbvh --layer normal --points r.npy -o h.npy --memory 16", "r.npy: reading it"},
        std::pair{"validate p.rbvh --against plate.ply --resolution 4000 --memory 100M",
                  "plate.ply: comparing"},
        std::pair{"validate p.rbvh --against plate.ply --resolution 64 --memory 20M", "p.rbvh: measuring"}})
    bad(words, 5, part);
}

}  // namespace
}  // namespace rbvh
