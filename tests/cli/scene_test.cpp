// Proxies and scenes through the command line: pictures of every kind, tessellated references, rays for
// scripts, and what is refused.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/npy.h"
#include "io/proxy_file.h"
#include "pipeline/proxy/check_proxy.h"
#include "tests/picture.h"
#include "tests/proxy_shapes.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

class SceneCommand : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    const std::uint32_t level = 4;
    Proxy proxy =
        displaced(quad_sphere(2), std::span(&level, 1), [](Vec3f p) { return mushrooms(p, 0.15f); });
    measure_displacements(proxy);
    ASSERT_EQ(find_fault(proxy), std::nullopt);
    save_proxy(path("rock.obj"), proxy);
    write("ball.ply", ball_ply(8));
    write("s.json", R"({"rbvh_scene": 1,
      "objects": {"rock": {"file": "rock.obj"}, "ball": {"file": "ball.ply"}, "pair": {"file": "ball.rbvh", "level": "Q3"},
                  "rocks": {"group": [{"object": "rock"}, {"object": "rock", "translate": [3, 0, 0], "scale": 0.5}]}},
      "instances": [{"object": "rocks"}, {"object": "ball", "translate": [0, 3, 0]},
                    {"object": "pair", "translate": [3, 3, 0], "scale": [1, -1, 1]}]})");
  }
  void build_pair() const {
    const ToolRun run = tool("build ball.ply -o ball.rbvh --levels Q3 -q");
    ASSERT_EQ(run.code, 0) << run.err;
  }
  void expect_refused(const std::string& words, int code, const std::string& part) const {
    const ToolRun run = tool(words + " -q");
    EXPECT_EQ(run.code, code) << words << "\n" << run.err;
    EXPECT_EQ(run.lines(), 1) << words << "\n" << run.err;
    EXPECT_NE(run.err.find(part), std::string::npos) << words << "\n" << run.err;
  }
  static std::size_t count_hits(const Picture& depth) {
    return static_cast<std::size_t>(
        std::count_if(depth.pixels.begin(), depth.pixels.end(), [](float z) { return std::isfinite(z); }));
  }
};

TEST_F(SceneCommand, PicturesOfAllKinds) {
  build_pair();
  for (const char* aov : {"shaded", "normal", "leaf", "steps"}) {
    const ToolRun run = tool(std::string("render s.json rock.obj -o '{name}-") + aov +
                             ".png' -q --resolution 64,48 --aov " + aov);
    EXPECT_EQ(run.code, 0) << aov << run.err;
    EXPECT_TRUE(exists(std::string("s-") + aov + ".png"));
    EXPECT_TRUE(exists(std::string("rock-") + aov + ".png"));
  }
  EXPECT_EQ(tool("render s.json -o z.exr -q --resolution 64,48 --aov depth").code, 0);
  EXPECT_EQ(tool("render s.json -o p.exr -q --resolution 64,48 --aov position").code, 0);
  EXPECT_GT(count_hits(read_picture(path("z.exr"))), 300u);
}

TEST_F(SceneCommand, TheTessellatedReferenceIsWhereTheProxyIs) {
  const std::string words = " -q --resolution 96,96 --aov depth";
  ASSERT_EQ(tool("render rock.obj -o direct.exr --detail 0.01" + words).code, 0);
  ASSERT_EQ(tool("render rock.obj -o tessellated.exr --tessellate 12" + words).code, 0);
  ASSERT_EQ(tool("render rock.obj -o coarse.exr --tessellate 1" + words).code, 0);
  const Picture direct = read_picture(path("direct.exr")),
                tessellated = read_picture(path("tessellated.exr")),
                coarse = read_picture(path("coarse.exr"));
  EXPECT_GT(count_hits(direct), 2000u);
  std::size_t differing = 0, coarser = 0;
  for (std::size_t i = 0; i < direct.pixels.size(); ++i) {
    differing += direct.pixels[i] != tessellated.pixels[i];
    coarser += direct.pixels[i] != coarse.pixels[i];
  }
  EXPECT_EQ(differing, 0u);
  EXPECT_GT(coarser, 1000u);
}

TEST_F(SceneCommand, TheCacheMayBeSmall) {
  const std::string words = " -q --resolution 64,64 --aov depth";
  ASSERT_EQ(tool("render rock.obj -o all.exr" + words).code, 0);
  ASSERT_EQ(tool("render rock.obj -o few.exr --patch-cache 30K --report r.json" + words).code, 0);
  EXPECT_EQ(read_picture(path("all.exr")).pixels, read_picture(path("few.exr")).pixels);
  EXPECT_NE(read("r.json").find("\"patches_evicted\""), std::string::npos);
  expect_refused("render rock.obj -o none.exr --aov depth --detail 1000 --patch-cache 100", 5, "patch cache");
  EXPECT_FALSE(exists("none.exr"));
}

TEST_F(SceneCommand, RaysForScripts) {
  std::vector<float> rays;
  for (int i = 0; i < 50; ++i)
    rays.insert(rays.end(), {0.02f * static_cast<float>(i) - 0.5f, 0.1f, 5, 0, 0, -2});
  write_npy(path("rays.npy"), rays, 6, true);
  build_pair();
  ASSERT_EQ(tool("trace rock.obj --rays rays.npy -o rock.npy -q").code, 0);
  const ToolRun run = tool("trace s.json --rays rays.npy -o scene.npy -q");
  ASSERT_EQ(run.code, 0) << run.err;
  const std::size_t columns[] = {8};
  const FloatTable rock = read_npy(path("rock.npy"), columns), scene = read_npy(path("scene.npy"), columns);
  ASSERT_EQ(rock.rows, 50u);
  for (std::size_t i = 0; i < rock.rows; ++i) {
    EXPECT_NEAR(rock.values[8 * i], 2, 0.3) << i;
    EXPECT_GE(rock.values[8 * i + 6], 0);
    EXPECT_LT(rock.values[8 * i + 6], 24);
    for (std::size_t column = 0; column < 8; ++column)  // the first instance, where it stands
      EXPECT_EQ(rock.values[8 * i + column], scene.values[8 * i + column]) << i << ' ' << column;
  }
}

TEST_F(SceneCommand, InfoAndValidateSayWhatIsThere) {
  build_pair();
  const ToolRun info = tool("info s.json --json");
  ASSERT_EQ(info.code, 0) << info.err;
  const nlohmann::json json = nlohmann::json::parse(info.out);
  EXPECT_EQ(json["kind"], "scene");
  EXPECT_EQ(json["instances"], 4);
  ASSERT_EQ(json["objects"].size(), 3u);  // in the order of their names
  EXPECT_EQ(json["objects"][0]["kind"], "mesh");
  EXPECT_EQ(json["objects"][1]["level"], "Q3");
  EXPECT_EQ(json["objects"][2]["kind"], "proxy");
  EXPECT_EQ(json["objects"][2]["instances"], 2);
  EXPECT_EQ(json["objects"][2]["leaves"], 24);
  EXPECT_EQ(json["objects"][0]["bytes"], std::filesystem::file_size(path("ball.ply")));
  std::uint64_t bytes = std::filesystem::file_size(path("s.json")), leaves = 0;
  for (const auto& object : json["objects"]) {
    bytes += object["bytes"].get<std::uint64_t>();
    leaves += object["leaves"].get<std::uint64_t>() * object["instances"].get<std::uint64_t>();
  }
  EXPECT_EQ(json["bytes"], bytes);
  EXPECT_EQ(json["leaves"], leaves);
  EXPECT_NE(tool("info s.json").out.find("4 instances"), std::string::npos);
  const ToolRun valid = tool("validate s.json");
  EXPECT_EQ(valid.code, 0) << valid.err;
  EXPECT_NE(valid.out.find("s.json: whole (3 objects, 4 instances"), std::string::npos) << valid.out;
  expect_refused("validate s.json --against ball.ply", 2, "this is a scene");
  std::filesystem::remove(path("ball.atlas.tif"));
  expect_refused("validate s.json", 3, "ball");
  expect_refused("info s.json", 3, "ball");
}

TEST_F(SceneCommand, MemoryCountsWhatIsCast) {
  std::vector<float> rays = {0, 0, 5, 0, 0, -1};
  write_npy(path("rays.npy"), rays, 6, true);
  build_pair();
  expect_refused("render s.json -o a.png --memory 100M --resolution 16,16", 5, "--memory");
  expect_refused("trace rock.obj --rays rays.npy -o h.npy --memory 100M", 5, "--memory");
  EXPECT_EQ(tool("trace rock.obj --rays rays.npy -o h.npy -q --memory 100M --patch-cache 10M").code, 0);
  write("large.ply", ball_ply(200));
  expect_refused("trace large.ply --rays rays.npy -o g.npy --memory 10M", 5, "--memory");
  EXPECT_FALSE(exists("g.npy"));
}

TEST_F(SceneCommand, WhatIsWrongIsOneLine) {
  expect_refused("render s.json -o a.png", 3, "ball.rbvh");  // not built yet
  expect_refused("render gone.json -o a.png", 3, "gone.json");
  write("lacks.json",
        R"({"rbvh_scene": 1, "objects": {"s": {"file": "gone.rbvh"}}, "instances": [{"object": "s"}]})");
  for (const char* words : {"info lacks.json", "validate lacks.json", "render lacks.json -o a.png"})
    expect_refused(words, 3,
                   "gone.rbvh: cannot be opened: No such file or directory (object \"s\" of lacks.json)");
  write("bad.json",
        R"({"rbvh_scene": 1, "objects": {"a": {"file": "ball.ply"}}, "instances": [{"object": "b"}]})");
  expect_refused("render bad.json -o a.png", 3, "places \"b\"");
  write(
      "level.json",
      R"({"rbvh_scene": 1, "objects": {"a": {"file": "ball.ply", "level": "Q0"}}, "instances": [{"object": "a"}]})");
  expect_refused("render level.json -o a.png", 3, "a level is named");
  build_pair();
  write(
      "level.json",
      R"({"rbvh_scene": 1, "objects": {"a": {"file": "ball.rbvh", "level": "Q9"}}, "instances": [{"object": "a"}]})");
  expect_refused("render level.json -o a.png", 3, "no level 'Q9'");
  expect_refused("render s.json -o a.png --compare wide16,bvh-stack", 2, "--compare is for scans");
  expect_refused("render rock.obj -o a.png --tessellate 13", 2, "--tessellate: '13'");
  expect_refused("render rock.obj -o a.png --detail 0", 2, "--detail: '0'");
  expect_refused("render rock.obj -o a.png --patch-cache lots", 2, "--patch-cache: 'lots'");
  EXPECT_FALSE(exists("a.png"));
}

}  // namespace
}  // namespace rbvh
