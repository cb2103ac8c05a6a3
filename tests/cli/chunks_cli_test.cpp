// rbvh build of scans larger than memory: what it leaves when it is killed, what it refuses, what it takes.
#include <sys/resource.h>

#include <chrono>
#include <map>
#include <random>

#include "rbvh/io.h"
#include "tests/las_file.h"
#include "tests/run_tool.h"
#include "tests/shapes.h"
#include "tests/textured.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

class ChunksToolTest : public ToolTest {
 protected:
  /// Of all files in a folder, by their names in it.
  std::map<std::string, std::string> bytes_in(const std::string& folder) const {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : fs::recursive_directory_iterator(path(folder)))
      if (entry.is_regular_file())
        bytes[fs::relative(entry.path(), path(folder)).string()] = read(entry.path().string());
    return bytes;
  }
};

TEST_F(ChunksToolTest, KilledBuildsGoOn) {
  write_ply(path("scan.ply"), bumpy_sphere(80), true);
  const std::string build = "build scan.ply --levels Q1,Q3 --chunks 6 -q";
  fs::create_directory(path("whole"));
  tool(build + " -o warm.rbvh");  // compiles the kernels
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(tool(build + " -o whole/a.rbvh").code, 0);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  const std::map<std::string, std::string> whole = bytes_in("whole");
  EXPECT_EQ(whole.size(), 2 + 2 * 6u);  // the table, the journal, and pairs

  const unsigned seed = std::random_device{}();
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> moment(0, seconds.count());
  for (int i = 0; i < 6; ++i) {
    fs::remove_all(path("killed"));
    fs::create_directory(path("killed"));
    for (int kills = 0; kills < 2; ++kills)
      tool(build + " --resume -o killed/a.rbvh", "timeout -s KILL " + std::to_string(moment(random)));
    const bool is_there = fs::exists(path("killed/a.rbvh"));
    EXPECT_EQ(tool(build + " --resume -o killed/a.rbvh" + (is_there ? " -f" : "")).code, 0);
    EXPECT_TRUE(bytes_in("killed") == whole) << "seed " << seed << ", kill " << i;
  }
}

TEST_F(ChunksToolTest, ResumedPartsAreNotBuiltAgain) {
  write_ply(path("scan.ply"), bumpy_sphere(60), true);
  const std::string build = "build scan.ply --levels Q2 --chunks 4 -o a.rbvh";
  good(build);
  const ToolRun again = tool(build + " -f --resume");
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_NE(again.err.find("4 parts"), std::string::npos) << again.err;
  // Other options leave nothing of the old parts.
  good("build scan.ply --levels Q2,Q4 --chunks 4 -o a.rbvh -f");
  int folders = 0;
  for (const auto& entry : fs::directory_iterator(path("."))) folders += entry.is_directory();
  EXPECT_EQ(folders, 1);
  good("render a.rbvh --level Q4 --resolution 64,64 -o a.png");
}

TEST_F(ChunksToolTest, StagesTakePartsOrSaySo) {
  write_ply(path("scan.ply"), bumpy_sphere(40), true);
  good("build scan.ply --levels Q1,Q3 --chunks 3 -o a.rbvh");
  good("render a.rbvh --resolution 64,64 -o a.png");
  good("render a.rbvh --level Q3 --resolution 64,64 -o b.png");
  good("validate a.rbvh");
  EXPECT_NE(tool("info a.rbvh").out.find("pair of 3 parts"), std::string::npos);
  EXPECT_NE(tool("info a.rbvh --json").out.find("\"kind\": \"parts\""), std::string::npos);
  bad("render a.rbvh --level Q0 -o c.png", 2, "there is no level 'Q0'");
  bad("render a.rbvh --level all -o 'c-{level}.png'", 2, "one level at a time");
  for (const char* words : {"lod a.rbvh --levels Q3 -o b.rbvh", "mesh a.rbvh -o b.ply",
                            "view a.rbvh -o b.html", "bake a.rbvh --layer ao -o b.rbvh"})
    bad(words, 3, "is a pair of parts");
  bad("validate a.rbvh --against scan.ply", 2, "pair of parts");
  // A part that is missing, and one that is another's.
  fs::path parts;
  for (const auto& entry : fs::directory_iterator(path(".")))
    if (entry.is_directory()) parts = entry.path();
  fs::copy_file(parts / "0001.rbvh", parts / "0000.rbvh", fs::copy_options::overwrite_existing);
  fs::copy_file(parts / "0001.atlas.tif", parts / "0000.atlas.tif", fs::copy_options::overwrite_existing);
  bad("validate a.rbvh", 3, "is not the part that its table names");
  fs::remove(parts / "0000.rbvh");
  bad("render a.rbvh --resolution 64,64 -o c.png", 3, "0000.rbvh");
  std::ofstream(path("a.rbvh"), std::ios::app) << " ";
  bad("info a.rbvh", 3, "cut or damaged");
}

TEST_F(ChunksToolTest, PairsAndTablesLeaveNothingOfEachOther) {
  write_ply(path("scan.ply"), bumpy_sphere(30), true);
  const std::string whole = "build scan.ply --levels Q3 -o a.rbvh -f", parts = whole + " --chunks 2";
  good(whole);
  good(parts);
  EXPECT_FALSE(fs::exists(path("a.atlas.tif")));
  good("validate a.rbvh");
  good(whole);
  EXPECT_EQ(files(), "a.atlas.tif a.rbvh scan.ply");
  // What is not its own stays: an atlas of another pair, a file in the folder, another's parts.
  std::ofstream(path("a.atlas.tif"), std::ios::app) << "more";
  good(parts);
  EXPECT_TRUE(fs::exists(path("a.atlas.tif")));
  fs::path folder;
  for (const auto& entry : fs::directory_iterator(path(".")))
    if (entry.is_directory()) folder = entry.path();
  std::ofstream(folder / "mine.txt") << "mine";
  fs::copy_file(path("a.rbvh"), path("b.rbvh"));
  good("build scan.ply --levels Q3 -o b.rbvh -f");
  good("validate a.rbvh");
  good(whole);
  EXPECT_TRUE(fs::exists(folder / "mine.txt"));
  EXPECT_FALSE(fs::exists(folder / "0000.rbvh"));
}

TEST_F(ChunksToolTest, RefusesInOneLine) {
  const Scan sphere = bumpy_sphere(40);
  write_ply(path("scan.ply"), sphere, true);
  const std::string bytes = read("scan.ply");
  std::ofstream(path("cut.ply"), std::ios::binary) << bytes.substr(0, bytes.size() - 100);
  bad("build scan.ply - -o c.rbvh < /dev/null", 3, "standard input: cannot be read twice");
  bad("build cut.ply --chunks 2 -o a.rbvh", 3, "the file is cut in face");
  std::ofstream(path("short.ply"), std::ios::binary) << bytes.substr(0, 4000);
  bad("build short.ply --chunks 2 -o a.rbvh", 3, "the file is cut in vertex");
  std::string wrong = bytes;  // ends in a corner and an object id
  wrong.replace(wrong.size() - 8, 4, "\xff\xff\xff\x7f");
  std::ofstream(path("wrong.ply"), std::ios::binary) << wrong;
  bad("build wrong.ply --chunks 2 -o a.rbvh", 3, "is out of range");
  Scan huge = sphere;
  for (Vec3f& p : huge.positions) p = p * 1e25f;
  write_ply(path("huge.ply"), huge, true);
  bad("build huge.ply --chunks 2 -o a.rbvh", 3, "huge.ply: the scan's area");
  std::ofstream(path("ball.ply"), std::ios::binary) << TexturedBall().ply();
  std::ofstream(path("ball.png"), std::ios::binary) << TexturedBall::png();
  bad("build ball.ply --chunks 2 -o a.rbvh", 3, "has textures");
  bad("build scan.ply --chunks 0 -o a.rbvh", 2, "--chunks");
  bad("build scan.ply --chunks 300 -o a.rbvh", 2, "--chunks");
  bad("build scan.ply --chunks 2 --measure -o a.rbvh", 2, "built in chunks");
  bad("build scan.ply --chunks 2 -o scan.ply/a.rbvh", 1, "");
  bad("build scan.ply --chunks 2 -o missing/a.rbvh", 1, "");
  bad("build scan.ply --memory 1K -o a.rbvh", 5, "raise --memory");
}

/// Two halves of a ball, without normals or radii.
void write_tiles(const std::string& first, const std::string& second, int points) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  LasFile tiles[2];
  for (int i = 0; i < points; ++i) {
    const double z = uniform(random), angle = 3.14159265 * uniform(random), r = std::sqrt(1 - z * z);
    tiles[z > 0 ? 1 : 0].points.push_back({static_cast<std::int32_t>(1e5 * r * std::cos(angle)),
                                           static_cast<std::int32_t>(1e6 * r * std::sin(angle)),
                                           static_cast<std::int32_t>(2e3 * z)});
  }
  std::ofstream(first, std::ios::binary) << tiles[0].bytes();
  std::ofstream(second, std::ios::binary) << tiles[1].bytes();
}

TEST_F(ChunksToolTest, SeveralFilesAreOneScan) {
  write_tiles(path("1.las"), path("2.las"), 20000);
  const ToolRun run = tool("build 1.las 2.las --levels Q2 --chunks 4 -o city.rbvh");
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("20000 normals estimated, in 4 cells"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("1.las: returns, scan angles"), std::string::npos) << run.err;
  const std::string info = tool("info city.rbvh").out;
  EXPECT_NE(info.find("pair of 4 parts"), std::string::npos) << info;
  EXPECT_NE(info.find("1.las and 1 more"), std::string::npos) << info;
  int folders = 0;
  for (const auto& entry : fs::directory_iterator(path("."))) folders += entry.is_directory();
  EXPECT_EQ(folders, 1) << "what was gathered is gone";
  good("build 1.las 2.las --levels Q2 -o whole.rbvh");
  good("render city.rbvh --resolution 96,96 --up +Z -o city.png");
  good("validate city.rbvh");
}

TEST_F(ChunksToolTest, KilledWhileTheyAreGathered) {
  write_tiles(path("1.las"), path("2.las"), 8000);
  const std::string build = "build 1.las 2.las --levels Q3 --chunks 3 -q";
  fs::create_directory(path("whole"));
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(tool(build + " -o whole/a.rbvh").code, 0);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  const std::map<std::string, std::string> whole = bytes_in("whole");
  const unsigned seed = std::random_device{}();
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> moment(0, seconds.count());
  for (int i = 0; i < 3; ++i) {
    fs::remove_all(path("killed"));
    fs::create_directory(path("killed"));
    tool(build + " --resume -o killed/a.rbvh", "timeout -s KILL " + std::to_string(moment(random)));
    const bool is_there = fs::exists(path("killed/a.rbvh"));
    EXPECT_EQ(tool(build + " --resume -o killed/a.rbvh" + (is_there ? " -f" : "")).code, 0);
    EXPECT_TRUE(bytes_in("killed") == whole) << "seed " << seed << ", kill " << i;
  }
}

TEST_F(ChunksToolTest, KeepsToItsMemoryWhileItGathers) {
  // Completing so many points at once takes 180 MB more.
  write_tiles(path("1.las"), path("2.las"), 500000);
  good("build 1.las 2.las --levels Q4 --memory 450M -o a.rbvh");
  EXPECT_NE(tool("info a.rbvh").out.find("pair of"), std::string::npos);
  rusage used{};
  getrusage(RUSAGE_CHILDREN, &used);
  EXPECT_LT(used.ru_maxrss, 450 * 1024);
}

TEST_F(ChunksToolTest, KeepsToItsMemory) {
  // A million triangles, which take 590 MB as a whole.
  write_ply(path("scan.ply"), bumpy_sphere(720), true);
  good("build scan.ply --levels Q2 --memory 450M -o a.rbvh");
  EXPECT_NE(tool("info a.rbvh").out.find("pair of"), std::string::npos);
  rusage used{};
  getrusage(RUSAGE_CHILDREN, &used);
  EXPECT_LT(used.ru_maxrss, 450 * 1024);
}

TEST_F(ChunksToolTest, WhatFitsIsBuiltAsBefore) {
  write_ply(path("scan.ply"), bumpy_sphere(60), true);
  good("build scan.ply --levels Q1 -o a.rbvh");
  good("build scan.ply --levels Q1 --memory 4G -o b.rbvh");
  EXPECT_EQ(read("a.rbvh"), read("b.rbvh"));
}

}  // namespace
}  // namespace rbvh
