// Levels of one's own errors, through the binary: built, shown, chosen by; and what the bytes go to.
#include <cmath>

#include "rbvh/build.h"
#include "tests/cli/pair_tool_test.h"

namespace rbvh {
namespace {

class LevelErrors : public PairToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(24));
  }
};

TEST_F(LevelErrors, LevelsAreBuiltForErrorsOfTheirOwn) {
  good("build ball.ply -o a.rbvh --levels Q4=5e-3,Q3,Q0=2e-6");
  const Json pair = info("a.rbvh"), levels = pair["levels"];
  ASSERT_EQ(levels.size(), 3u);
  const double diagonal = pair["source"]["diagonal"];
  EXPECT_NEAR(diagonal, std::sqrt(12.0), 0.1);
  const double errors[] = {2e-6, static_cast<double>(standard_levels()[3].error), 5e-3};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(levels[i]["name"], std::string("Q") + "034"[i]);
    EXPECT_NEAR(levels[i]["error"].get<double>(), errors[i], 1e-6 * errors[i]);
    EXPECT_NEAR(levels[i]["error_length"].get<double>(), errors[i] * diagonal, 1e-5 * errors[i]);
    EXPECT_NEAR(levels[i]["rho"].get<double>(), static_cast<double>(level_of_error(errors[i]).rho), 1);
  }
  EXPECT_GE(levels[0]["primitives"], levels[1]["primitives"]);
  EXPECT_GT(levels[1]["primitives"], levels[2]["primitives"]);
}

TEST_F(LevelErrors, OneLevelIsBuiltForALength) {
  good("build ball.ply -o bare.rbvh --error 0.01");
  const Json bare = info("bare.rbvh");
  const double diagonal = bare["source"]["diagonal"];
  ASSERT_EQ(bare["levels"].size(), 1u);
  const Json& level = bare["levels"][0];
  EXPECT_EQ(level["name"], "Q4") << "the nearest of the standard levels";
  EXPECT_NEAR(level["error_length"].get<double>(), 0.01, 1e-7);
  EXPECT_NEAR(level["error"].get<double>(), 0.01 / diagonal, 1e-8);
  // The same with units, which ingest states and the pair keeps.
  good("ingest ball.ply -o none.ply");
  good("ingest ball.ply -o metres.ply --units m");
  EXPECT_EQ(info("none.ply")["units"], "unknown");
  EXPECT_EQ(info("metres.ply")["units"], "m");
  good("build none.ply -o none.rbvh --error 0.01units");
  good("build metres.ply -o metres.rbvh --error 10mm");
  const Json metres = info("metres.rbvh");
  EXPECT_EQ(metres["source"]["units"], "m");
  EXPECT_EQ(metres["levels"], info("none.rbvh")["levels"]);
  good("mesh metres.rbvh -o mesh.ply");
  EXPECT_EQ(info("mesh.ply")["units"], "m");
  bad("build none.ply -o x.rbvh --error 10mm", 2, "none.ply: its units are not known");
  bad("build metres.ply -o x.rbvh --error 1km", 2, "is not between 1e-06 and 0.1");
  bad("ingest metres.ply -o x.ply --units mm", 2, "states that it is in m");
  bad("ingest metres.ply none.ply -o x.ply", 3, "different units (m, none)");
  bad("ingest ball.ply -o x.ply --units parsec", 2, "mm, cm, m, km, in or ft");
}

TEST_F(LevelErrors, WhatMakesNoLevelIsRefused) {
  bad("build ball.ply -o x.rbvh --levels Q0=1e-5,Q7", 2, "there is no level 'Q7'");
  bad("build ball.ply -o x.rbvh --levels Q0=1e-7", 2, "is not between 1e-06 and 0.1");
  bad("build ball.ply -o x.rbvh --levels Q0=,Q1", 2, "--levels: ''");
  bad("build ball.ply -o x.rbvh --levels Q0=1e-3,Q2", 2, "level Q2's error");
  bad("build ball.ply -o x.rbvh --levels Q0=1e-5 --levels-by density", 2, "--levels: levels by density");
  bad("build ball.ply -o x.rbvh --error 0.01 --levels-by density", 2, "--error: levels by density");
  bad("build ball.ply -o x.rbvh --error 0.01 --levels Q1", 2, "--error and --levels");
  bad("build ball.ply -o x.rbvh --error 1furlong", 2, "--error: '1furlong' is not a number above 0");
  bad("build ball.ply -o x.rbvh --error 20%", 2, "is not between");
}

TEST_F(LevelErrors, LodChoosesByWhatIsKnown) {
  good("ingest ball.ply -o m.ply --units m");
  good("build m.ply -o a.rbvh --levels Q1=1e-4,Q2=1e-3,Q3=1e-2");
  const double millimetres = 1000 * info("a.rbvh")["source"]["diagonal"].get<double>();  // of the diagonal
  const auto chosen = [&](const std::string& error) {
    const ToolRun run = tool("lod a.rbvh -f -o b.rbvh --max-error " + error);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.err.find("is chosen by the error that it was built for"), std::string::npos) << run.err;
    return info("b.rbvh")["levels"][0]["name"].get<std::string>();
  };
  EXPECT_EQ(chosen("0.1"), "Q2") << "percent";
  EXPECT_EQ(chosen("0.1%"), "Q2");
  EXPECT_EQ(chosen("0.099%"), "Q1");
  EXPECT_EQ(chosen(std::to_string(1.01e-3 * millimetres) + "mm"), "Q2");
  EXPECT_EQ(chosen(std::to_string(0.99e-3 * millimetres) + "mm"), "Q1");
  EXPECT_EQ(chosen(std::to_string(1.01e-3 * millimetres / 1000) + "units"), "Q2");
  std::filesystem::remove(path("b.rbvh"));
  std::filesystem::remove(path("b.atlas.tif"));
  bad("lod a.rbvh -o b.rbvh --max-error 0.001mm", 5, "no level is within");
  bad("lod a.rbvh -o b.rbvh --max-error 1in2", 2, "--max-error: '1in2'");
  good("build ball.ply -o plain.rbvh --levels Q4");
  bad("lod plain.rbvh -o b.rbvh --max-error 1mm", 2, "its units are not known");
  // What was measured counts more: this level is nearer to the scan than it had to be.
  good("build m.ply -o near.rbvh --levels Q4=1e-2 --measure --views 1 --resolution 32");
  const double reached = info("near.rbvh")["levels"][0]["reached"]["error"];
  ASSERT_LT(reached, 0.9e-2);
  bad("lod near.rbvh -o b.rbvh --max-error " + std::to_string(99 * reached) + "%", 5, "no level is within");
  const ToolRun run = tool("lod near.rbvh -o b.rbvh --max-error " + std::to_string(101 * reached) + "%");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(run.err.find("is chosen by"), std::string::npos) << run.err;
}

TEST_F(LevelErrors, ALevelThatMissesItsErrorIsNamed) {
  std::string vertices, faces;
  constexpr int kSide = 200;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i)
      vertices +=
          std::to_string(i) + " " + std::to_string((i * 31 + j * 17) % 7) + " " + std::to_string(j) + "\n";
  for (int j = 0; j + 1 < kSide; ++j)
    for (int i = 0; i + 1 < kSide; ++i) {
      const int a = j * kSide + i;
      faces +=
          "3 " + std::to_string(a) + " " + std::to_string(a + kSide) + " " + std::to_string(a + 1) + "\n";
      faces += "3 " + std::to_string(a + 1) + " " + std::to_string(a + kSide) + " " +
               std::to_string(a + kSide + 1) + "\n";
    }
  write("rough.ply", "ply\nformat ascii 1.0\nelement vertex " + std::to_string(kSide * kSide) +
                         "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                         std::to_string(2 * (kSide - 1) * (kSide - 1)) +
                         "\nproperty list uchar int vertex_indices\nend_header\n" + vertices + faces);
  const ToolRun run = tool("build rough.ply -o rough.rbvh --levels Q4 --hybrid off --progress none");
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("farther from the scan than asked for"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("Q4 0.0"), std::string::npos) << run.err;
  good("ingest rough.ply -o whole.ply");
  const ToolRun parts =
      tool("build whole.ply -o parts.rbvh --levels Q4 --hybrid off --chunks 2 --progress none");
  ASSERT_EQ(parts.code, 0) << parts.err;
  EXPECT_NE(parts.err.find("farther from the scan than asked for"), std::string::npos) << parts.err;
  EXPECT_NE(parts.err.find("Q4 0.0"), std::string::npos) << parts.err;
  const Json level = info("rough.rbvh")["levels"][0];
  EXPECT_GT(level["reached"]["error"], level["error"]);
  EXPECT_TRUE(level["reached"]["max"].is_null());
  EXPECT_EQ(tool("info rough.rbvh").code, 0);
  bad("lod rough.rbvh -o x.rbvh --max-error 0.06%", 5, "no level is within");
  const ToolRun fine = tool("build ball.ply -o fine.rbvh --levels Q4 --progress none");
  EXPECT_EQ(fine.err.find("farther"), std::string::npos) << fine.err;
}

TEST_F(LevelErrors, InfoShowsWhatWasAskedForAndReached) {
  good("build ball.ply -o a.rbvh --levels Q3=4e-4,Q4 --measure --views 1 --resolution 32");
  const Json pair = info("a.rbvh");
  const double diagonal = pair["source"]["diagonal"];
  for (const Json& level : pair["levels"]) {
    const Json &reached = level["reached"], &fidelity = level["fidelity"];
    EXPECT_NEAR(reached["error"].get<double>(),
                std::max(fidelity["level_to_scan"]["rms_percent"].get<double>(),
                         fidelity["scan_to_level"]["rms_percent"].get<double>()) /
                    100,
                1e-9);
    EXPECT_LE(reached["error"], level["error"]);
    EXPECT_GE(reached["max"], reached["error"]);
    EXPECT_NEAR(reached["error_length"].get<double>(), reached["error"].get<double>() * diagonal, 1e-9);
    EXPECT_NEAR(reached["max_length"].get<double>(), reached["max"].get<double>() * diagonal, 1e-9);
  }
  const std::string text = tool("info a.rbvh").out;
  EXPECT_NE(text.find("asked for"), std::string::npos) << text;
  EXPECT_NE(text.find("\nQ3        0.0004 "), std::string::npos) << text;
  // Neither asked for nor measured.
  good("build ball.ply -o b.rbvh --levels Q4 --levels-by density");
  const Json plain = info("b.rbvh")["levels"][0];
  EXPECT_EQ(plain["error"], 0);
  EXPECT_TRUE(plain["reached"].is_null());
  EXPECT_NE(tool("info b.rbvh").out.find("\nQ4             -           -         -           -"),
            std::string::npos)
      << tool("info b.rbvh").out;
}

TEST_F(LevelErrors, InfoShowsWhereTheBytesAre) {
  good("build ball.ply -o a.rbvh --levels Q1,Q3");
  good("build ball.ply -o tiles.rbvh --levels Q3 --levels-by density --hybrid off");
  for (const std::string stem : {"a", "tiles"}) {
    std::uint64_t all = 0;
    for (const Json& level : info(stem + ".rbvh")["levels"]) {
      std::uint64_t sum = 0;
      for (const auto& [name, bytes] : level["streams"].items()) sum += bytes.get<std::uint64_t>();
      for (const Json& layer : level["layers"]) {
        EXPECT_GT(layer["bytes"], 0) << layer["name"];
        sum += layer["bytes"].get<std::uint64_t>();
      }
      EXPECT_LE(sum, level["bytes"]);
      EXPECT_GT(sum + 2000, level["bytes"]) << "but for the atlas's headers";
      EXPECT_EQ(level["streams"]["positions"] > 0, stem == "a");
      EXPECT_EQ(level["streams"]["radii"], 0);
      all += sum;
    }
    EXPECT_LT(all, bytes(stem));
  }
  EXPECT_GT(info("tiles.rbvh")["levels"][0]["layers"][0]["bytes"], 1000);
  const std::string text = tool("info a.rbvh --bytes").out;
  for (const Json& level : info("a.rbvh")["levels"])
    for (const char* stream : {"tree", "leaves", "positions", "triangles"}) {
      EXPECT_NE(text.find(stream), std::string::npos) << text;
      EXPECT_NE(text.find(" " + level["streams"][stream].dump()), std::string::npos) << stream << "\n"
                                                                                     << text;
    }
  EXPECT_EQ(text.find("radii"), std::string::npos) << "of a mesh there are none";
  EXPECT_EQ(tool("info a.rbvh").out.find("positions"), std::string::npos);
  bad("info ball.ply --bytes", 2, "--bytes is for pairs");
}

TEST_F(LevelErrors, APairThatIsLargerThanItsScanIsSaidToBe) {
  write("tetrahedron.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
  const ToolRun run = tool("build tetrahedron.ply -o a.rbvh --progress none --report r.json");
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("times as large as tetrahedron.ply (210 B); build fewer or coarser levels"),
            std::string::npos)
      << run.err;
  const Json report = Json::parse(read("r.json"))["bytes"];
  EXPECT_EQ(report["scan"], 210);
  EXPECT_DOUBLE_EQ(report["pair_to_scan"], static_cast<double>(bytes("a")) / 210);
  const ToolRun one = tool("build tetrahedron.ply -o a.rbvh -f --levels Q0 --progress none");
  EXPECT_NE(one.err.find("; build a coarser level"), std::string::npos) << one.err;
  const ToolRun small = tool("build ball.ply -o b.rbvh --levels Q4 --progress none --report s.json");
  EXPECT_EQ(small.err.find("times as large"), std::string::npos) << small.err;
  EXPECT_LT(Json::parse(read("s.json"))["bytes"]["pair_to_scan"], 1);
}

}  // namespace
}  // namespace rbvh
