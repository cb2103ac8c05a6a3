// Textured scans from file to picture: OBJ, PLY and GLB, through ingest and without.
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/picture.h"
#include "tests/run_tool.h"
#include "tests/textured.h"

namespace rbvh {
namespace {

class Textured : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("ball.obj", ball_.obj());
    write("ball.mtl", TexturedBall::mtl());
    write("ball.png", TexturedBall::png());
    write("ball.ply", ball_.ply());
    write("ball.glb", ball_.glb());
  }

  Picture picture(const std::string& scan, const std::string& more = "") const {
    good("render " + scan + " --quick --resolution 160,160 --view iso -f -o p.png " + more);
    return read_picture(path("p.png"));
  }

  /// In 255ths.
  static double difference(const Picture& a, const Picture& b) {
    EXPECT_EQ(a.pixels.size(), b.pixels.size());
    double most = 0;
    for (std::size_t i = 0; i < std::min(a.pixels.size(), b.pixels.size()); ++i)
      most = std::max(most, 255 * std::abs(static_cast<double>(a.pixels[i] - b.pixels[i])));
    return most;
  }

  /// Of channels from 0 to 1.
  static double root_mean_square(const Picture& a, const Picture& b) {
    EXPECT_EQ(a.pixels.size(), b.pixels.size());
    double sum = 0;
    for (std::size_t i = 0; i < std::min(a.pixels.size(), b.pixels.size()); ++i)
      sum += std::pow(static_cast<double>(a.pixels[i] - b.pixels[i]), 2);
    return std::sqrt(sum / static_cast<double>(a.pixels.size()));
  }

  /// Runs the words, which must succeed, and returns what they warn of.
  std::string warnings(const std::string& words) const {
    const ToolRun run = tool(words);
    EXPECT_EQ(run.code, 0) << words << run.err;
    return run.err;
  }

  TexturedBall ball_;
};

TEST_F(Textured, SamePictureOfEachFormat) {
  const Picture obj = picture("ball.obj"), ply = picture("ball.ply"), glb = picture("ball.glb");
  EXPECT_LE(difference(obj, ply), 1.01);
  EXPECT_LE(difference(obj, glb), 1.01);
  // It is there: a ball of clay differs.
  write("bare.obj", ball_.obj("none.mtl"));
  EXPECT_GT(difference(obj, picture("bare.obj")), 50);
}

TEST_F(Textured, IngestKeepsThem) {
  const Picture from = picture("ball.obj");
  good("ingest ball.obj -o out.ply");
  EXPECT_EQ(read("out.texture0.png"), TexturedBall::png());
  const std::string head = read("out.ply").substr(0, 500);
  EXPECT_NE(head.find("comment TextureFile out.texture0.png\n"), std::string::npos) << head;
  EXPECT_NE(head.find("list uchar float texcoord"), std::string::npos);
  good("ingest out.ply -o out.glb");
  good("ingest out.glb -o again.ply");
  EXPECT_EQ(read("again.texture0.png"), TexturedBall::png());
  for (const char* file : {"out.ply", "out.glb", "again.ply"})
    EXPECT_LE(difference(from, picture(file)), 1.01) << file;
  bad("ingest ball.obj -o out.ply", 1, "exists");
  std::filesystem::remove(path("out.ply"));
  bad("ingest ball.obj -o out.ply", 1, "out.texture0.png");
  EXPECT_NE(warnings("ingest ball.obj -o - > piped.ply").find("1 texture cannot lie beside it"),
            std::string::npos);
}

TEST_F(Textured, MergedScansKeepTheirOwn) {
  good("ingest ball.obj ball.glb -o two.ply");
  EXPECT_TRUE(exists("two.texture0.png") && exists("two.texture1.png"));
  EXPECT_LE(difference(picture("ball.obj"), picture("two.ply")), 1.01);
  const auto info = nlohmann::json::parse(tool("info two.ply --json").out);
  ASSERT_EQ(info["textures"].size(), 2u);
  EXPECT_EQ(info["textures"][1]["width"], TexturedBall::kWidth);
}

TEST_F(Textured, LostImagesCostTheTextureAlone) {
  const std::string png = TexturedBall::png();
  std::string damaged = png;
  for (std::size_t i = png.size() / 2; i < png.size() / 2 + 40; ++i) damaged[i] = 'x';
  std::string huge = png;
  huge.replace(16, 8, std::string("\0\1\0\0\0\1\0\0", 8));  // 65536 x 65536
  const std::pair<std::string, std::string> kinds[] = {{png.substr(0, png.size() / 2), "is cut"},
                                                       {"", "is empty"},
                                                       {"no image at all", "is no PNG"},
                                                       {damaged, "cannot be decoded"},
                                                       {huge, ""}};
  for (const auto& [bytes, words] : kinds) {
    write("ball.png", bytes);
    const std::string said = warnings("ingest ball.obj -f -o out.ply");
    EXPECT_NE(said.find("1728 faces have lost their textures: 'ball.png' " + words), std::string::npos)
        << said;
    EXPECT_EQ(read("out.ply").find("TextureFile"), std::string::npos);
  }
  EXPECT_NE(warnings("render ball.ply --quick --resolution 8,8 -f -o p.png").find("1728 faces have lost"),
            std::string::npos);
  std::filesystem::remove(path("ball.png"));
  EXPECT_NE(warnings("ingest ball.obj -f -o out.ply").find("'ball.png' is not there"), std::string::npos);
  std::filesystem::remove(path("ball.mtl"));
  EXPECT_NE(warnings("ingest ball.obj -f -o out.ply").find("its materials are not there: 'ball.mtl'"),
            std::string::npos);
}

TEST_F(Textured, NamesOfOtherMachinesAreFoundByTheirLastPart) {
  const Picture from = picture("ball.obj");
  for (const char* name : {"C:\\scans\\old\\ball.png", "/nowhere/ball.png", "../elsewhere/ball.png",
                           "-clamp on ball.png", "-s 1 1 1 -o 0 0 0 ball.png"}) {
    write("ball.mtl", TexturedBall::mtl(name));
    EXPECT_LE(difference(from, picture("ball.obj")), 1.01) << name;
  }
  std::filesystem::create_directory(path("sub"));
  write("sub/with blank.png", TexturedBall::png());
  write("ball.mtl", TexturedBall::mtl("sub\\with blank.png"));
  EXPECT_LE(difference(from, picture("ball.obj")), 1.01);
}

TEST_F(Textured, AReplacedImageIsToldFromTheOneWrittenWithTheScan) {
  good("ingest ball.obj -o out.ply");
  write("out.texture0.png", TexturedBall::png() + "more");
  EXPECT_NE(warnings("ingest out.ply -o again.ply").find("is not the one that was written with it"),
            std::string::npos);
  EXPECT_TRUE(exists("again.texture0.png"));
}

TEST_F(Textured, APairShowsWhatTheScanShows) {
  write("ball.obj", TexturedBall(48).obj());
  good("build ball.obj --levels Q0,Q3 -o ball.rbvh");
  const auto info = nlohmann::json::parse(tool("info ball.rbvh --json").out);
  for (const auto& level : info["levels"]) {
    EXPECT_EQ(level["layers"].back()["name"], "texture");
    EXPECT_EQ(level["layers"].back()["channels"], 3);
  }
  // Not to be told from exact: nearer to it than it is to itself a quarter pixel aside.
  const auto measured = nlohmann::json::parse(
      tool("validate ball.rbvh --against ball.obj --views 2 --resolution 192 --json").out);
  for (const auto& level : measured["fidelity"]) EXPECT_LT(level["image_relative"], 1) << level["level"];
  // The colours of vertices alone are no such thing.
  good("build ball.obj --levels Q0 --color-scale 0.0625 -o coarse.rbvh");
  const auto coarse = nlohmann::json::parse(
      tool("validate coarse.rbvh --against ball.obj --views 2 --resolution 192 --json").out);
  EXPECT_GT(coarse["fidelity"][0]["image_relative"], 1);
  EXPECT_LT(std::filesystem::file_size(path("coarse.atlas.tif")),
            std::filesystem::file_size(path("ball.atlas.tif")));
}

TEST_F(Textured, DerivedLevelsCarryThem) {
  good("build ball.obj --levels Q1 -o ball.rbvh");
  good("lod ball.rbvh --levels Q3 -o derived.rbvh");
  const ToolRun view = tool("view ball.rbvh -o v.html");
  EXPECT_EQ(view.code, 0) << view.err;
  EXPECT_EQ(view.err.find("texture"), std::string::npos)
      << view.err;  // pages show them: nothing is to be said
  EXPECT_LT(root_mean_square(picture("ball.obj"), picture("derived.rbvh")), 0.05);
}

// Of triangles, of tiles, and of both: what a pair shows, its meshes and tilesets show to other programs.
TEST_F(Textured, MeshesAndTilesetsShowThem) {
  write("ball.obj", TexturedBall(48).obj());
  for (const auto& [hybrid, level] : {std::pair<std::string, std::string>{"auto", "Q0"}, {"off", "Q4"}}) {
    good("build ball.obj --levels " + level + " --hybrid " + hybrid + " -f -o ball.rbvh");
    const Picture pair = picture("ball.rbvh");
    good("tiles ball.rbvh -f -o tiles");
    good("mesh ball.rbvh -f -o m.ply");
    good("mesh ball.rbvh -f -o m.glb");
    for (const std::string& mesh : {std::string("m.ply"), std::string("m.glb"), "tiles/" + level + ".glb"})
      EXPECT_LT(root_mean_square(pair, picture(mesh)), 0.03) << hybrid << " " << mesh;
  }
}

TEST_F(Textured, FacesWithoutATextureKeepTheirColours) {
  // Half of the faces name no material, and vertices are coloured.
  std::string obj = ball_.obj(), mixed;
  std::size_t faces = 0;
  for (std::size_t at = 0, end = 0; at < obj.size(); at = end + 1) {
    end = obj.find('\n', at);
    std::string line = obj.substr(at, end - at);
    if (line.starts_with("v ")) line += " 1 0 0";
    if (line.starts_with("usemtl")) continue;
    if (line.starts_with("f ") && ++faces == 432) line = "usemtl skin\n" + line;
    mixed += line + "\n";
  }
  write("mixed.obj", mixed);
  good("build mixed.obj --levels Q0 -o mixed.rbvh");
  const Picture exact = picture("mixed.obj"), pair = picture("mixed.rbvh");
  int red = 0, other = 0, apart = 0;
  for (int y = 0; y < exact.height; ++y)
    for (int x = 0; x < exact.width; ++x) {
      const float *a = exact.at(x, y), *b = pair.at(x, y);
      if (a[3] < 1 || b[3] < 1) continue;
      const bool is_red = a[0] > 0.2f && a[1] < 0.1f && a[2] < 0.1f;
      (is_red ? red : other) += 1;
      apart += is_red != (b[0] > 0.2f && b[1] < 0.1f && b[2] < 0.1f);
    }
  EXPECT_GT(red, 500);
  EXPECT_GT(other, 500);
  EXPECT_LT(apart, (red + other) / 20);
}

TEST_F(Textured, ColorScaleIsOfTexturedScans) {
  write("bare.ply", ball_ply(6));
  bad("build bare.ply --color-scale 2 -o x.rbvh", 2, "--color-scale: it has no textures");
  bad("build ball.obj --color-scale 17 -o x.rbvh", 2, "--color-scale");
}

}  // namespace
}  // namespace rbvh
