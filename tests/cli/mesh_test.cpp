// rbvh mesh through the binary: a level for other programs.
#include <cstring>
#include <nlohmann/json.hpp>

#include "tests/run_tool.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

/// The parts of a GLB; its header, lengths and padding are checked.
struct Glb {
  Json json;
  std::string binary;

  explicit Glb(const std::string& bytes) {
    const auto word = [&](std::size_t at) {
      std::uint32_t value = 0;
      std::memcpy(&value, bytes.data() + at, sizeof value);
      return value;
    };
    if (bytes.size() < 28) throw std::runtime_error("a GLB has 28 bytes at least");
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(word(4), 2u);
    EXPECT_EQ(word(8), bytes.size());
    const std::size_t json_bytes = word(12), binary_at = 20 + json_bytes;
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    EXPECT_EQ(json_bytes % 4, 0u);
    json = Json::parse(bytes.substr(20, json_bytes));
    EXPECT_EQ(bytes.substr(binary_at + 4, 4), std::string("BIN\0", 4));
    EXPECT_EQ(word(binary_at), bytes.size() - binary_at - 8);
    EXPECT_EQ(word(binary_at) % 4, 0u);
    binary = bytes.substr(binary_at + 8);
    EXPECT_LE(json["buffers"][0]["byteLength"], binary.size());
  }
  const Json& primitive() const { return json["meshes"][0]["primitives"][0]; }
  const Json& accessor(const std::string& attribute) const {
    return json["accessors"][primitive()["attributes"].at(attribute).get<std::size_t>()];
  }
  const char* data(const Json& accessor) const {
    const Json& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    EXPECT_LE(view.value("byteOffset", 0u) + view["byteLength"].get<std::size_t>(), binary.size());
    return binary.data() + view.value("byteOffset", 0u);
  }
};

class MeshStage : public ToolTest {
 protected:
  Json report(const std::string& words) const {
    good(words + " -f --report r.json");
    return Json::parse(read("r.json"));
  }
};

TEST_F(MeshStage, ALevelBecomesAClosedPly) {
  write("ball.ply", ball_ply(200));
  good("build ball.ply -o ball.rbvh --levels Q2,Q4 --levels-by density --hybrid off");
  for (const std::string level : {"Q2", "Q4"}) {
    const Json made = report("mesh ball.rbvh --level " + level + " -o mesh.ply");
    EXPECT_EQ(made["level"], level);
    // The ball itself is open along a seam.
    EXPECT_LT(made["counts"]["open_edges"], made["counts"]["triangles"].get<int>() / 50) << level;
    EXPECT_EQ(made["counts"]["non_manifold_edges"], 0) << level;
    // Clean: ingest takes nothing away.
    const Json cleaned = report("ingest mesh.ply -o clean.ply");
    const Json info = Json::parse(tool("info clean.ply --json").out);
    EXPECT_EQ(info["triangles"], made["counts"]["triangles"]) << cleaned;
    EXPECT_EQ(info["vertices"], made["counts"]["vertices"]);
  }
  good("mesh ball.rbvh -o finest.ply");
  good("mesh ball.rbvh --level Q2 -o q2.ply");
  EXPECT_EQ(read("finest.ply"), read("q2.ply"));
  const ToolRun run = tool("mesh ball.rbvh --level Q2 -o -");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(run.out, read("q2.ply"));
  EXPECT_NE(run.err.find(" open edges"), std::string::npos) << run.err;
}

TEST_F(MeshStage, AGlbHoldsTheSame) {
  write("ball.ply", ball_ply(60));
  good("build ball.ply -o ball.rbvh --levels Q3");
  const Json counts = report("mesh ball.rbvh -o ball.glb")["counts"];
  const Glb glb(read("ball.glb"));
  EXPECT_EQ(glb.json["asset"]["version"], "2.0");
  EXPECT_FALSE(glb.json["nodes"][0].contains("rotation"));  // a mesh is +Y up, as glTF is
  EXPECT_EQ(glb.primitive().value("mode", 4), 4);
  const Json &position = glb.accessor("POSITION"), &normal = glb.accessor("NORMAL"),
             &index = glb.json["accessors"][glb.primitive()["indices"].get<std::size_t>()];
  EXPECT_EQ(position["count"], counts["vertices"]);
  EXPECT_EQ(normal["count"], counts["vertices"]);
  EXPECT_EQ(index["count"].get<std::size_t>(), 3 * counts["triangles"].get<std::size_t>());
  EXPECT_EQ(index["componentType"], 5125);
  std::vector<std::uint32_t> indices(index["count"].get<std::size_t>());
  std::memcpy(indices.data(), glb.data(index), 4 * indices.size());
  EXPECT_EQ(*std::max_element(indices.begin(), indices.end()) + 1, counts["vertices"]);
  EXPECT_NEAR(position["max"][1].get<double>(), 1, 0.06);
  good("mesh ball.rbvh -o again.glb --threads 1");
  EXPECT_EQ(read("again.glb"), read("ball.glb"));
}

TEST_F(MeshStage, CloudsArePointsWithColorsAndAShift) {
  std::string points;
  for (int j = 0; j < 50; ++j)
    for (int i = 0; i < 50; ++i)
      points += std::to_string(500000 + 0.01 * i) + " " + std::to_string(0.01 * j) + " 7 255 0 188\n";
  write("cloud.xyz", points);
  good("ingest cloud.xyz -o cloud.ply");
  good("build cloud.ply -o cloud.rbvh --levels Q4");
  const Json counts = report("mesh cloud.rbvh -o cloud.glb")["counts"];
  EXPECT_EQ(counts["triangles"], 0);
  const Glb glb(read("cloud.glb"));
  EXPECT_EQ(glb.primitive()["mode"], 0);
  EXPECT_FALSE(glb.primitive().contains("indices"));
  EXPECT_EQ(glb.accessor("_RADIUS")["count"], counts["vertices"]);
  const Json& color = glb.accessor("COLOR_0");
  EXPECT_EQ(color["componentType"], 5121);
  EXPECT_EQ(color["normalized"], true);
  const auto* rgba = reinterpret_cast<const std::uint8_t*>(glb.data(color));
  EXPECT_EQ(rgba[0], 255);
  EXPECT_EQ(rgba[1], 0);
  EXPECT_NEAR(rgba[2], 128, 4);  // 188 of sRGB is half the light
  EXPECT_EQ(rgba[3], 255);
  EXPECT_EQ(glb.json["asset"]["extras"]["rbvh_shift"][0], 500000);
  EXPECT_NEAR(glb.json["nodes"][0]["rotation"][0].get<double>(), -0.7071, 1e-4);  // +Z is up
  good("mesh cloud.rbvh -o points.ply");
  const Json info = Json::parse(tool("info points.ply --json").out);
  EXPECT_EQ(info["vertices"], counts["vertices"]);
  EXPECT_NE(read("points.ply").find("property float radius"), std::string::npos);
  EXPECT_NE(read("points.ply").find("comment rbvh shift 5e+05 "), std::string::npos);
}

TEST_F(MeshStage, WhatIsWrongIsSaidInOneLine) {
  write("ball.ply", ball_ply(16));
  good("build ball.ply -o ball.rbvh --levels Q3");
  bad("mesh ball.rbvh --level Q0 -o x.ply", 2, "Q3");
  bad("mesh ball.rbvh --level Q3,Q4 -o x.ply", 2, "one level");
  bad("mesh ball.ply -o x.ply", 3, "no .rbvh pair");
  bad("mesh missing.rbvh -o x.ply", 3, "missing.rbvh");
  bad("mesh ball.rbvh -o x.obj", 2, ".glb");
  bad("mesh ball.rbvh -o ball.ply", 1, "ball.ply");
  bad("mesh ball.rbvh -o nowhere/x.glb", 1, "nowhere");
  for (const char* device : {"/dev/full"}) {
    const ToolRun run = tool(std::string("mesh ball.rbvh -f -q -o - > ") + device);
    EXPECT_EQ(run.code, 1);
    EXPECT_EQ(run.lines(), 1) << run.err;
  }
}

}  // namespace
}  // namespace rbvh
