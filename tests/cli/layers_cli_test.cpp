// lod, paint, sample and what build has for them, through the binary.
#include <cmath>

#include "io/npy.h"
#include "tests/cli/pair_tool_test.h"

namespace rbvh {
namespace {

class Detail : public PairToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(16));
  }
  std::string levels(const std::string& file) const {
    std::string names;
    const Json json = info(file);
    for (const Json& level : json["levels"])
      names += level["name"].get<std::string>() + (level["derived_from"].is_null() ? " " : "* ");
    return names;
  }
};

TEST_F(Detail, LodKeepsDropsAndDerivesLevelsByName) {
  good("build ball.ply -o a.rbvh --levels Q2,Q4");
  good("lod a.rbvh --levels Q4 -o kept.rbvh --report r.json");
  EXPECT_EQ(levels("kept.rbvh"), "Q4 ");
  EXPECT_EQ(Json::parse(read("r.json"))["levels"][0]["name"], "Q4");
  good("lod a.rbvh --drop Q2 -o dropped.rbvh");
  EXPECT_EQ(read("dropped.rbvh"), read("kept.rbvh"));
  EXPECT_EQ(read("dropped.atlas.tif"), read("kept.atlas.tif"));
  good("lod a.rbvh --levels Q3,Q4 -o derived.rbvh");
  EXPECT_EQ(levels("derived.rbvh"), "Q3* Q4 ");
  good("lod a.rbvh --levels Q3,Q4 -o again.rbvh --threads 1");
  EXPECT_EQ(read("again.rbvh"), read("derived.rbvh"));
  EXPECT_EQ(read("again.atlas.tif"), read("derived.atlas.tif"));
  good("render derived.rbvh --level Q3 -o q3.png --resolution 64,64");
  bad("lod a.rbvh --levels Q0 -o x.rbvh", 2, "Q0");
  bad("lod a.rbvh --levels Q9 -o x.rbvh", 2, "Q9");
  bad("lod a.rbvh --drop Q3 -o x.rbvh", 2, "Q3");
  bad("lod a.rbvh --drop Q2,Q4 -o x.rbvh", 2, "no level");
  bad("lod a.rbvh -o x.rbvh", 2, "--levels");
  bad("lod ball.ply --levels Q1 -o x.rbvh", 3, "no .rbvh");
  bad("lod a.rbvh --levels Q2 -o kept.rbvh", 1, "kept.rbvh");
  bad("lod a.rbvh --levels Q2 -o a.rbvh -f", 2, "a.rbvh");
}

TEST_F(Detail, LodFitsIntoBytes) {
  good("build ball.ply -o a.rbvh --levels Q3,Q4 --hybrid off");
  const std::uintmax_t all = bytes("a");
  good("lod a.rbvh --max-bytes " + std::to_string(all) + " -o all.rbvh");
  EXPECT_EQ(levels("all.rbvh"), "Q3 Q4 ");
  good("lod a.rbvh --max-bytes " + std::to_string(all - 1) + " -o less.rbvh");
  EXPECT_EQ(levels("less.rbvh"), "Q3 ");
  EXPECT_LT(bytes("less"), all);
  good("lod a.rbvh --levels Q3 -o one.rbvh");
  good("lod one.rbvh --max-bytes " + std::to_string(bytes("one") - 1) + " -o small.rbvh");
  EXPECT_EQ(levels("small.rbvh"), "Q4* ");
  EXPECT_LT(bytes("small"), bytes("one"));
  bad("lod a.rbvh --max-bytes 2kB -o x.rbvh", 5, "no level fits");
  bad("lod a.rbvh --max-bytes none -o x.rbvh", 2, "--max-bytes");
}

TEST_F(Detail, LodKeepsToAnError) {
  good("build ball.ply -o plain.rbvh --levels Q4 --levels-by density --hybrid off");
  bad("lod plain.rbvh --max-error 1 -o x.rbvh", 3, "--measure");
  good("lod plain.rbvh --max-error 90 -o coarse.rbvh --against ball.ply --views 2 --resolution 128");
  EXPECT_EQ(levels("coarse.rbvh"), "Q4 ");
  EXPECT_TRUE(info("coarse.rbvh")["levels"][0]["fidelity"].contains("image"));
  good("build ball.ply -o a.rbvh --levels Q3,Q4 --hybrid off --measure --views 2 --resolution 128");
  const Json measured = info("a.rbvh")["levels"];
  double error[2];
  for (std::size_t i = 0; i < 2; ++i)
    error[i] = std::max(measured[i]["fidelity"]["level_to_scan"]["rms_percent"].get<double>(),
                        measured[i]["fidelity"]["scan_to_level"]["rms_percent"].get<double>());
  EXPECT_LT(error[0], error[1]);
  good("lod a.rbvh --max-error " + std::to_string(1.01 * error[0]) + " -o middle.rbvh");
  EXPECT_EQ(levels("middle.rbvh"), "Q3 ");
  EXPECT_EQ(info("middle.rbvh")["levels"][0]["fidelity"], measured[0]["fidelity"])
      << "what was measured stays";
  bad("lod a.rbvh --max-error " + std::to_string(0.5 * error[0]) + " -o x.rbvh", 5, "no level is within");
}

TEST_F(Detail, BuildMeasuresAndValidateHoldsItAgainst) {
  good(
      "build ball.ply -o a.rbvh --levels Q4 --hybrid off --measure --report r.json --views 2 --resolution "
      "128");
  EXPECT_GT(Json::parse(read("r.json"))["levels"][0]["fidelity"]["image"]["ssim"], 0.5);
  const Json stored = info("a.rbvh")["levels"][0]["fidelity"];
  EXPECT_EQ(stored["views"], 2);
  EXPECT_EQ(stored["resolution"], 128);
  EXPECT_GT(stored["image_relative"], 0.0);
  EXPECT_NE(tool("info a.rbvh").out.find("of the control's; 2 views"), std::string::npos);
  const ToolRun same =
      tool("validate a.rbvh --against ball.ply --json --progress none --views 2 --resolution 128");
  EXPECT_EQ(same.code, 0) << same.err;
  EXPECT_EQ(same.err.find("warning"), std::string::npos) << same.err;
  const Json found = Json::parse(same.out)["fidelity"][0];
  EXPECT_EQ(found["as_stored"], true);
  EXPECT_EQ(found["stored"], stored);
  EXPECT_NEAR(found["image"]["rmse"].get<double>(), stored["image"]["rmse"].get<double>(), 1e-5);
  EXPECT_NEAR(found["image_relative"].get<double>(), stored["image_relative"].get<double>(), 1e-4);
  // Other views are not compared; another scan is reported.
  const ToolRun other = tool("validate a.rbvh --against ball.ply --json --views 1 --resolution 64 -q");
  EXPECT_TRUE(Json::parse(other.out)["fidelity"][0]["as_stored"].is_null());
  write("rough.ply", ball_ply(7));
  const ToolRun rough =
      tool("validate a.rbvh --against rough.ply --json --progress none --views 2 --resolution 128");
  EXPECT_EQ(Json::parse(rough.out)["fidelity"][0]["as_stored"], false);
  EXPECT_NE(rough.err.find("where the file says"), std::string::npos) << rough.err;
}

TEST_F(Detail, PaintThenSampleGivesBackWhatWasPainted) {
  good("build ball.ply -o a.rbvh --levels Q2,Q4");
  // Points on the ball, from rays.
  write_npy(path("rays.npy"), std::vector<float>{0.3f, 0.2f, 4, 0, 0, -1, -0.3f, 0.1f, 4, 0, 0, -1}, 6,
            false);
  good("trace a.rbvh --level Q2 --rays rays.npy -o hits.npy");
  // From a pipe, whose end is not known before.
  EXPECT_EQ(
      shell("cat rays.npy | '" RBVH_TOOL "' trace a.rbvh --level Q2 --rays - -o - -q | cmp - hits.npy").code,
      0);
  for (const char* const other : {"head -c -1 rays.npy", "cat rays.npy rays.npy"}) {
    const ToolRun run = shell(std::string(other) + " | '" RBVH_TOOL "' trace a.rbvh --rays - -o x.npy -q");
    EXPECT_EQ(run.code, 3) << other;
    EXPECT_EQ(run.lines(), 1) << run.err;
    EXPECT_FALSE(exists("x.npy"));
  }
  const std::size_t eight[] = {8}, one[] = {1}, three[] = {3};
  const FloatTable hits = read_npy(path("hits.npy"), eight);
  const std::vector<float> points = {0.3f, 0.2f, 4 - hits.values[0], -0.3f, 0.1f, 4 - hits.values[8], 5,
                                     5,    5};
  write_npy(path("p.npy"), points, 3, false);
  write_npy(path("v.npy"), std::vector<float>{1.5f, -2, 9}, 1, false);
  const ToolRun paint = tool(
      "paint a.rbvh --layer wear --points p.npy --values v.npy --radius 0.1 -o b.rbvh --layer-scale 2 "
      "--report r.json");
  EXPECT_EQ(paint.code, 0) << paint.err;
  EXPECT_NE(paint.err.find("1 of 3 points"), std::string::npos) << "one is off the surface: " << paint.err;
  const Json report = Json::parse(read("r.json"));
  EXPECT_EQ(report["counts"]["missed"], 1);
  EXPECT_GT(report["counts"]["texels"], 100);
  EXPECT_EQ(info("b.rbvh")["levels"][1]["layers"].back()["name"], "wear");
  for (const char* level : {"Q2", "Q4"}) {
    good(std::string("sample b.rbvh --layer wear --points p.npy -f -o s.npy --level ") + level);
    const FloatTable values = read_npy(path("s.npy"), one);
    EXPECT_NEAR(values.values[0], 1.5, 1e-3) << level;
    EXPECT_NEAR(values.values[1], -2, 1e-3) << level;
    EXPECT_TRUE(std::isnan(values.values[2]));
  }
  // Derived levels carry it.
  good("lod b.rbvh --levels Q3 -o c.rbvh");
  good("sample c.rbvh --layer wear --points p.npy -f -o s.npy");
  EXPECT_NEAR(read_npy(path("s.npy"), one).values[1], -2, 1e-3);
  good("paint a.rbvh --layer wear --level Q4 --points p.npy --values v.npy --radius 0.1 -o q4.rbvh");
  EXPECT_EQ(info("q4.rbvh")["levels"][0]["layers"].size() + 1, info("q4.rbvh")["levels"][1]["layers"].size());
  // In place, with -f only; on the layer that is there.
  bad("paint b.rbvh --layer wear --points p.npy --values v.npy", 1, "b.rbvh");
  bad("paint b.rbvh --layer wear --points p.npy --values v.npy --layer-scale 2 -o x.rbvh", 2,
      "--layer-scale");
  write_npy(path("w.npy"), std::vector<float>{40, 41, 42}, 1, false);
  good("paint b.rbvh --layer wear --points p.npy --values w.npy -f");
  good("sample b.rbvh --layer wear --points p.npy -f -o s.npy");
  EXPECT_NEAR(read_npy(path("s.npy"), one).values[0], 40, 1e-3);
  good("render b.rbvh --color-layer wear -o wear.png --resolution 64,64");
  good("render b.rbvh -o plain.png --resolution 64,64");
  EXPECT_NE(read("wear.png"), read("plain.png"));
  bad("render b.rbvh --color-layer none -o x.png", 2, "none");
  good("sample b.rbvh --layer normal --points p.npy -o n.npy");
  EXPECT_GT(read_npy(path("n.npy"), three).values[2], 0.7f);
  good("sample b.rbvh --layer height --points p.npy -o h.npy");
  EXPECT_NEAR(read_npy(path("h.npy"), one).values[0], 0, 1e-3);
  bad("sample b.rbvh --layer none --points p.npy -o x.npy", 2, "no layer");
  bad("sample ball.ply --layer none --points p.npy -o x.npy", 3, "no .rbvh");
  bad("paint b.rbvh --layer height --points p.npy --values v.npy -o x.rbvh", 2, "height");
  bad("paint b.rbvh --layer wear --points p.npy -o x.rbvh", 2, "--values");
  bad("paint b.rbvh --layer a/b --points p.npy --values v.npy -o x.rbvh", 2, "--layer");
  bad("paint b.rbvh --layer wear --points p.npy --values hits.npy -o x.rbvh", 3, "hits.npy");
  bad("paint b.rbvh --layer wear --points v.npy --values v.npy -o x.rbvh", 3, "v.npy");
  bad("paint b.rbvh --layer wear --points p.npy --values p.npy -o x.rbvh", 2, "3");
  bad("paint b.rbvh --layer new --points p.npy --values v.npy --layer-scale 99 -o x.rbvh", 2,
      "--layer-scale");
  bad("paint b.rbvh --layer wear --points p.npy --values v.npy --radius -1 -o x.rbvh", 2, "--radius");
}

TEST_F(Detail, ValuesThatNoLayerCanHold) {
  good("build ball.ply -o a.rbvh --levels Q4");
  write_npy(path("p.npy"), std::vector<float>{0.3f, 0.2f, 0.95f, -0.3f, 0.1f, 0.95f}, 3, false);
  const float infinity = std::numeric_limits<float>::infinity();
  write_npy(path("far.npy"), std::vector<float>{3e38f, -3e38f}, 1, false);
  write_npy(path("one.npy"), std::vector<float>{3e38f, 3e38f}, 1, false);
  write_npy(path("low.npy"), std::vector<float>{-3e38f, -3e38f}, 1, false);
  write_npy(path("infinite.npy"), std::vector<float>{infinity, 2}, 1, false);
  const std::string paint = "paint a.rbvh --layer wear --points p.npy --reach 0.2 ";
  bad(paint + "--values far.npy -o x.rbvh", 3, "-3e+38 to 3e+38");
  good(paint + "--values one.npy -o one.rbvh");
  good("sample one.rbvh --layer wear --points p.npy --reach 0.2 -o one_back.npy");
  const std::size_t one[] = {1};
  EXPECT_EQ(read_npy(path("one_back.npy"), one).values[0], 3e38f);
  bad("paint one.rbvh --layer wear --points p.npy --reach 0.2 --values low.npy -o x.rbvh", 3, "3e+38");
  const ToolRun run = tool(paint + "--values infinite.npy -o infinite.rbvh");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("infinite.npy: 1 infinite value,"), std::string::npos) << run.err;
  good("sample infinite.rbvh --layer wear --points p.npy --reach 0.2 -o back.npy");
  EXPECT_TRUE(std::isnan(read_npy(path("back.npy"), one).values[0]));
  EXPECT_NEAR(read_npy(path("back.npy"), one).values[1], 2, 1e-3);
  write("hot.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "property float heat\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 1\n1 0 0 inf\n0 1 0 -inf\n3 0 1 2\n");
  for (const char* words : {"build hot.ply -o hot.rbvh --levels Q4 --layer heat",
                            "paint hot.rbvh --layer heat --scan hot.ply -f"}) {
    const ToolRun hot = tool(words);
    EXPECT_EQ(hot.code, 0) << hot.err;
    EXPECT_NE(hot.err.find("hot.ply: 2 infinite values"), std::string::npos) << hot.err;
  }
}

TEST_F(Detail, LodSaysThatAScanIsAnother) {
  good("build ball.ply -o a.rbvh --levels Q4 --hybrid off");
  write("other.xyz", "9 9 9\n10 9 9\n9 10 9\n");
  for (const char* part : {"other.xyz: does not lie where the scan that a.rbvh was built of does",
                           "It has 3 points, and ball.ply had 960 triangles"})
    bad("lod a.rbvh --max-error 90 --against other.xyz -o x.rbvh", 3, part);
  const ToolRun run = tool("validate a.rbvh --against other.xyz --views 1 --resolution 64 --progress none");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("warning: other.xyz: does not lie where"), std::string::npos) << run.err;
}

TEST_F(Detail, OptionsThatMeanNothingAreRefusedOrSaid) {
  good("build ball.ply -o a.rbvh --levels Q4");
  write_npy(path("p.npy"), std::vector<float>{0, 0, 4}, 3, false);
  write_npy(path("rays.npy"), std::vector<float>{0, 0, 4, 0, 0, -2}, 6, false);
  const std::string render = "render -o x.png --resolution 16,16 ", trace = "trace --rays rays.npy -o x.npy ";
  for (const std::string& words :
       {render + "a.rbvh --tessellate 3", render + "a.rbvh --detail 2", render + "ball.ply --patch-cache 1M",
        trace + "a.rbvh --patch-cache 1M", trace + "ball.ply --patch-cache 1M"})
    bad(words, 2, "is for proxies and scenes");
  bad(render + "a.rbvh --aov depth --samples 4 -f -o y.exr", 2, "");
  bad("render a.rbvh -o x.exr --aov depth --samples 4", 2, "shaded");
  bad("render a.rbvh -o x.exr --aov depth --color-layer wear", 2, "shaded");
  bad(render + "ball.ply --compare wide16,bvh-stack --samples 2", 2, "--samples");
  bad(trace + "ball.ply --cone 1", 2, "--cone");
  bad(trace + "ball.ply --level auto", 2, "--cone");
  bad(trace + "ball.ply --level auto --cone 180", 2, "180");
  bad(trace + "ball.ply --level auto --cone 1", 2, "no pair");
  bad(trace + "a.rbvh --level all", 2, "one level");
  bad("sample a.rbvh --layer normal --points p.npy -o x.npy --level all", 2, "one level");
  bad("build ball.ply -o x.rbvh --views 2", 2, "--measure");
  bad("build ball.ply -o x.rbvh --resolution 64", 2, "--measure");
  bad("build ball.ply -o x.rbvh --layer-scale 2", 2, "--layer");
  bad("build ball.ply -o x.rbvh --focus-level Q1", 2, "--focus-level");
  bad("lod a.rbvh --levels Q4 -o x.rbvh --views 2", 2, "--against");
  bad("validate a.rbvh --level Q4", 2, "--against");
  bad("validate a.rbvh --pictures there", 2, "--against");
  bad("paint a.rbvh --layer wear --scan ball.ply --radius 1 -o x.rbvh", 2, "--radius");
  bad("paint a.rbvh --layer wear --scan ball.ply --reach 1 -o x.rbvh", 2, "--reach");
  // For a scan, which has no levels, the option is ignored with a note.
  for (const std::string& words : {render + "ball.ply -f --level Q2", trace + "ball.ply -f --level Q2"}) {
    const ToolRun run = tool(words + " --progress none");
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.err.find("ball.ply has no levels; --level is ignored"), std::string::npos) << run.err;
  }
}

TEST_F(Detail, PairsAreNamedAsSuch) {
  good("build ball.ply -o a.rbvh --levels Q4");
  bad("build a.rbvh -o x.rbvh", 3, "a.rbvh: is an .rbvh pair, and a scan is wanted");
  bad("ingest ball.ply -o x.PTX", 2, "name the output .ply");
  bad("ingest a.rbvh -o x.ply", 3, "a.rbvh: is an .rbvh pair");
  write("huge.obj", "v 0 0 0\nv 1e30 0 0\nv 0 1e30 0\nf 1 2 3\n");
  bad("build huge.obj -o x.rbvh", 3, "huge.obj: the scan's area is beyond");
  bad("build ball.ply -o x.ply --levels Q4", 2, "name the output x.rbvh");
  bad("build ball.ply -o x.atlas.tif --levels Q4", 2, "NAME.rbvh");
  bad("lod a.rbvh --levels Q4 -o x.obj", 2, "x.rbvh");
  write_npy(path("p.npy"), std::vector<float>{0, 0, 1}, 3, false);
  bad("paint a.rbvh --layer wear --points p.npy --values p.npy -o b.ply", 2, "b.rbvh");
}

TEST_F(Detail, OneIsSingular) {
  const ToolRun build = tool("build ball.ply -o a.rbvh --levels Q4");
  EXPECT_NE(build.err.find("(1 level, "), std::string::npos) << build.err;
  EXPECT_NE(tool("validate a.rbvh").out.find("(1 level, "), std::string::npos);
  write("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_NE(tool("info one.obj").out.find("3 vertices, 1 triangle, 1 object"), std::string::npos);
  write_npy(path("rays.npy"), std::vector<float>{0, 0, 4, 0, 0, 0}, 6, false);
  EXPECT_NE(tool("trace a.rbvh --rays rays.npy -o hits.npy").err.find("1 ray not finite"), std::string::npos);
}

TEST_F(Detail, PropertiesOfTheScanBecomeLayers) {
  std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 400\nproperty float x\nproperty float y\nproperty float z\n"
      "property float heat\nelement face 722\nproperty list uchar int vertex_indices\nend_header\n";
  for (int j = 0; j < 20; ++j)
    for (int i = 0; i < 20; ++i)
      ply += std::to_string(i) + " " + std::to_string(j) + " 0 " + std::to_string(10 * i + 1) + "\n";
  for (int j = 0; j < 19; ++j)
    for (int i = 0; i < 19; ++i) {
      const int a = 20 * j + i;
      ply += "3 " + std::to_string(a) + " " + std::to_string(a + 1) + " " + std::to_string(a + 20) + "\n3 " +
             std::to_string(a + 1) + " " + std::to_string(a + 21) + " " + std::to_string(a + 20) + "\n";
    }
  write("grid.ply", ply);
  good("build grid.ply -o a.rbvh --levels Q3 --layer heat --layer-scale 0.5");
  good("build grid.ply -o b.rbvh --levels Q3");
  good("paint b.rbvh --layer heat --scan grid.ply --layer-scale 3 -f");
  write_npy(path("p.npy"), std::vector<float>{5.25f, 7, 0, 12.5f, 3.3f, 0}, 3, false);
  const std::size_t one[] = {1};
  for (const char* file : {"a.rbvh", "b.rbvh"}) {
    good(std::string("sample -f -o s.npy --layer heat --points p.npy ") + file);
    const FloatTable values = read_npy(path("s.npy"), one);
    EXPECT_NEAR(values.values[0], 53.5, 0.1) << file;
    EXPECT_NEAR(values.values[1], 126, 0.1) << file;
  }
  EXPECT_EQ(info("a.rbvh")["build_options"]["layer_scale"], 0.5);
  const Json layer = info("b.rbvh")["levels"][0]["layers"].back();
  EXPECT_NEAR(layer["lo"].get<double>(), 1, 1e-3);
  EXPECT_NEAR(layer["hi"].get<double>(), 191, 1e-3);
  EXPECT_NE(layer["atlas"], info("b.rbvh")["levels"][0]["atlas"]);
  bad("build grid.ply -o x.rbvh --levels Q3 --layer cold", 2, "cold");
  bad("paint b.rbvh --layer cold --scan grid.ply -o x.rbvh", 2, "cold");
}

TEST_F(Detail, RaysChooseTheirLevelByTheirWidth) {
  good("build ball.ply -o a.rbvh --levels Q1,Q4");
  good("render a.rbvh --level auto --quick --view front -o '{level}.png' --resolution 32,32");
  good("render a.rbvh --level Q4 --quick --view front -o '{level}.png' --resolution 32,32");
  EXPECT_EQ(read("auto.png"), read("Q4.png")) << "a pixel covers many texels";
  write_npy(path("rays.npy"), std::vector<float>{0, 0, 4, 0, 0, -2}, 6, false);
  const std::size_t eight[] = {8};
  const auto leaf = [&](const std::string& words) {
    good("trace a.rbvh --rays rays.npy -f -o hits.npy " + words);
    return read_npy(path("hits.npy"), eight).values[6];
  };
  const float fine = static_cast<float>(info("a.rbvh")["levels"][0]["leaves"].get<int>());
  EXPECT_LT(leaf("--level auto --cone 0"), fine);
  EXPECT_GE(leaf("--level auto --cone 179.5"), fine) << "any cone short of half of all directions";
  EXPECT_GE(leaf("--level auto --cone 20"), fine) << "leaves of all levels are numbered through";
  bad("trace a.rbvh --rays rays.npy -o x.npy --level auto", 2, "--cone");
  bad("trace a.rbvh --rays rays.npy -o x.npy --cone 1", 2, "--cone");
  bad("sample a.rbvh --layer normal --points rays.npy -o x.npy --level auto", 3, "rays.npy");
  bad("validate a.rbvh --against ball.ply --level auto", 2, "auto");
}

TEST_F(Detail, PartitionOptionsChangeThePair) {
  good("build ball.ply -o a.rbvh --levels Q3 --levels-by density --hybrid off");
  const Json plain = info("a.rbvh");
  EXPECT_EQ(plain["build_options"]["split"], "median");
  for (const std::string words :
       {"--split sah", "--rays incoherent", "--focus 0,0,1 --focus-radius 0.3 --focus-level Q2",
        "--focus-camera 0,0,3"}) {
    good("build ball.ply -f -o b.rbvh --levels Q3 --levels-by density --hybrid off " + words);
    EXPECT_NE(read("b.atlas.tif"), read("a.atlas.tif")) << words;
    EXPECT_NE(info("b.rbvh")["build_options"], plain["build_options"]) << words;
  }
  good(
      "build ball.ply -f -o b.rbvh --levels Q3 --levels-by density --hybrid off --rays coherent --split "
      "median "
      "--partition device");
  EXPECT_EQ(read("b.rbvh"), read("a.rbvh"));
  EXPECT_EQ(plain["build_options"]["partition"], "device");
  good("build ball.ply -f -o b.rbvh --levels Q3 --levels-by density --hybrid off --partition host");
  const Json by_host = info("b.rbvh");
  EXPECT_EQ(by_host["build_options"]["partition"], "host");
  const double leaves = plain["levels"][0]["leaves"];
  EXPECT_NEAR(by_host["levels"][0]["leaves"].get<double>(), leaves, 0.02 * leaves);
  for (const std::string words :
       {"--split no", "--partition no", "--rays no", "--focus 0,0", "--focus 0,0,0", "--focus-radius 1",
        "--focus 0,0,0 --focus-radius 0", "--focus-camera 0,0,3 --focus-level Q7",
        "--focus 0,0,0 --focus-radius 1 --focus-camera 0,0,3"})
    bad("build ball.ply -o x.rbvh --levels Q3 " + words, 2, "");
}

}  // namespace
}  // namespace rbvh
