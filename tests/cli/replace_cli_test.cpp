// What users see where replacing a pair or a proxy goes wrong. Every way it may is in
// tests/format/replace_test.cpp.
#include <cstring>

#include "io/file_set.h"
#include "io/npy.h"
#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "tests/format/pair_bytes.h"
#include "tests/proxies.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

/// Of an array of one value: what is interpolated may be off by a rounding.
float last_float(const std::string& npy) {
  float value;
  std::memcpy(&value, npy.data() + npy.size() - sizeof value, sizeof value);
  return value;
}

class ReplaceCli : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    std::filesystem::create_directory(path("out"));
  }
  /// `fault` (tests/faults/fail_syscalls.c) happens to the N-th renaming in out/.
  ToolRun tool_at(int n, const std::string& fault, const std::string& words) const {
    return tool(words, "LD_PRELOAD=" RBVH_FAULTS " RBVH_FAULT_FOLDER=" + path("out") +
                           " RBVH_FAULT_CALLS=rename" + " RBVH_FAULT_AT=" + std::to_string(n) +
                           " RBVH_FAULT=" + fault);
  }
};

// Stages that write a pair rename three times: the atlas aside, the hierarchy, the atlas.
TEST_F(ReplaceCli, AKilledBuildLeavesAPair) {
  write("ball.ply", ball_ply(8));
  good("build ball.ply -o out/a.rbvh --levels Q4");
  const std::string before = read("out/a.rbvh");
  for (const int n : {2, 3}) {
    EXPECT_EQ(tool_at(n, "kill", "build ball.ply -o out/a.rbvh --levels Q3 -f -q").code, 137);
    EXPECT_EQ(read("out/a.rbvh") == before, n == 2);
    good("validate out/a.rbvh");
  }
  write_npy(path("points.npy"), std::vector<float>{0, 1, 0}, 3, false);
  write_npy(path("values.npy"), std::vector<float>{7}, 1, false);
  const std::string paint = "paint out/a.rbvh --layer wear --points points.npy --values values.npy -f -q";
  EXPECT_EQ(tool_at(3, "kill", paint).code, 137);
  good("sample out/a.rbvh --layer wear --points points.npy -o read.npy");
  EXPECT_NEAR(last_float(read("read.npy")), last_float(read("values.npy")), 1e-5);
  good(paint);
  EXPECT_EQ(files(), "ball.ply out out/a.atlas.tif out/a.rbvh points.npy read.npy values.npy");
}

TEST_F(ReplaceCli, AnErrorBeforeAndAWarningAfter) {
  write_rbvh(path("both.rbvh"), make_small_rbvh(), false);
  good("lod both.rbvh --levels Q1 -o out/a.rbvh");
  const std::string before = read("out/a.rbvh");
  bad("lod both.rbvh --levels Q0 -o out/a.rbvh", 1, "--force");
  const std::string replace = "lod both.rbvh --levels Q0 -o out/a.rbvh -f";
  const ToolRun failed = tool_at(2, std::to_string(EACCES), replace + " -q");
  EXPECT_EQ(failed.code, 1);
  EXPECT_EQ(failed.lines(), 1) << failed.err;
  EXPECT_NE(failed.err.find("out/a.rbvh: cannot be moved into place: Permission denied"), std::string::npos)
      << failed.err;
  EXPECT_EQ(read("out/a.rbvh"), before);

  EXPECT_EQ(tool_at(3, std::to_string(EPERM), replace + " -q").err, "");
  const ToolRun warned = tool_at(3, std::to_string(EPERM), replace);
  EXPECT_EQ(warned.code, 0) << warned.err;
  EXPECT_EQ(warned.lines(), 2) << warned.err;  // and what was written
  EXPECT_NE(warned.err.find("warning: out/a.atlas.tif cannot be replaced (Operation not permitted)"),
            std::string::npos)
      << warned.err;
  PairHeader header;
  read_rbvh(path("out/a.rbvh"), &header);
  const std::string atlas = std::filesystem::path(header.atlas_file).filename().string();
  EXPECT_NE(warned.err.find(atlas), std::string::npos) << warned.err;
  EXPECT_NE(tool("info --json out/a.rbvh").out.find(atlas), std::string::npos);
}

TEST_F(ReplaceCli, AProxyWhoseFilesCannotBeReplaced) {
  save_proxy(path("base.obj"), make_two_patch_proxy());
  const std::string words = "proxy base.obj --vdm base.vdm.exr -o out/a.obj";
  good(words + " --vdm-scale 0.5");
  const ToolRun run = tool_at(4, std::to_string(EPERM) + "+", words + " -f");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("a.obj cannot be replaced"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("a.vdm.exr cannot be replaced"), std::string::npos) << run.err;
  good("validate out/a.obj");
  for (const auto& entry : std::filesystem::directory_iterator(path("out")))
    if (parse_addressed(entry.path().filename().string()) && entry.path().extension() == ".obj")
      bad("ingest " + entry.path().string() + " -o scan.ply", 3, "is a file of the proxy");
  good(words + " -f");
  EXPECT_EQ(files(), "base.obj base.vdm.exr base.vdm.json out out/a.obj out/a.vdm.exr out/a.vdm.json");
}

}  // namespace
}  // namespace rbvh
