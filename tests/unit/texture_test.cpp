// Textures: what readers keep of them, and what they show at places.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "io/obj_materials.h"
#include "io/texture_files.h"
#include "pipeline/base/srgb.h"
#include "pipeline/scan/ingest.h"
#include "pipeline/scan/linear_color.h"
#include "pipeline/scan/texture_sampler.h"
#include "tests/scan_bytes.h"
#include "tests/textured.h"

namespace rbvh {
namespace {

using Uvs = std::array<std::array<float, 2>, 3>;

class TextureFiles : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "rbvh_texture_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string put(const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return (folder_ / name).string();
  }
  std::filesystem::path folder_;
};

const std::string kMtl = "newmtl a\nmap_Kd a.png\nnewmtl plain\nKd 1 0 0\nnewmtl b\nmap_Kd b.png\n";
const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

TEST_F(TextureFiles, ObjFacesHaveTheirOwnPlaces) {
  put("m.mtl", kMtl);
  const std::string obj =
      "mtllib m.mtl\n" + kSquare +
      "f 1/1 2/2 3/3\nusemtl a\nf 1/1 2/2 3/3 4/4\nusemtl plain\nf 1/1 2/2 3/3\nusemtl b\n"
      "f 1/-4 2/-1 3/-2\nf 1 2 3\nf 1/9 2/2 3/3\nf 1/x 2/2 3/3\n";
  EXPECT_THROW(parse_scan(obj, (folder_ / "m.obj").string()), Error);  // x is no index
  const RawScan scan = parse_scan(obj.substr(0, obj.rfind("f 1/x")) + "vt nonsense\nf 1/5 2/2 3/3\n",
                                  (folder_ / "m.obj").string());
  ASSERT_EQ(scan.face_textures.size(), 8u);
  ASSERT_EQ(scan.textures.size(), 2u);
  EXPECT_EQ(scan.textures[0].image->name, "a.png");
  constexpr std::uint32_t kNone = FaceTexture::kNone;
  const std::uint32_t expected[] = {kNone, 0, 0, kNone, 1, kNone, kNone, 1};
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(scan.face_textures[i].texture, expected[i]) << i;
  EXPECT_EQ(scan.face_textures[1].corners, (Uvs{{{0, 0}, {1, 0}, {1, 1}}}));
  EXPECT_EQ(scan.face_textures[2].corners, (Uvs{{{0, 0}, {1, 1}, {0, 1}}}));
  EXPECT_EQ(scan.face_textures[4].corners, (Uvs{{{0, 0}, {0, 1}, {1, 1}}}));
  EXPECT_TRUE(std::isnan(scan.face_textures[7].corners[0][0]));
  EXPECT_EQ(scan.notes,
            (std::vector<std::string>{"2 faces of materials with an image have no texture coordinates"}));
}

TEST_F(TextureFiles, ConcavePolygonsKeepTheirPlaces) {
  put("m.mtl", kMtl);
  // An arrow head: the fan from its first corner is wrong. u and v are x and y.
  const std::string points = "v 0 0 0\nv 2 -1 0\nv 1 0 0\nv 2 1 0\n",
                    places = "vt 0 0\nvt 2 -1\nvt 1 0\nvt 2 1\n";
  const std::string ply_points = "2 -1 0\n1 0 0\n2 1 0\n0 0 0\n";
  const std::string ply =
      "ply\nformat ascii 1.0\ncomment TextureFile a b.png\nelement vertex 4\nproperty float x\n"
      "property float y\nproperty float z\nelement face 1\nproperty list uchar float texcoord\n"
      "property uchar texnumber\nproperty list uchar int vertex_index\nend_header\n" +
      ply_points + "8 2 -1 1 0 2 1 0 0 0 4 0 1 2 3\n";
  for (const RawScan& scan : {parse_scan("mtllib m.mtl\nusemtl a\n" + points + places + "f 2/2 3/3 4/4 1/1\n",
                                         (folder_ / "m.obj").string()),
                              parse_scan(ply, "a.ply")}) {
    ASSERT_EQ(scan.triangles.size(), 2u);
    ASSERT_EQ(scan.face_textures.size(), 2u);
    for (std::size_t f = 0; f < 2; ++f)
      for (std::size_t c = 0; c < 3; ++c) {
        const Vec3d p = scan.positions[scan.triangles[f][c]];
        EXPECT_EQ(scan.face_textures[f].corners[c],
                  (std::array{static_cast<float>(p.x), static_cast<float>(p.y)}));
      }
  }
  EXPECT_EQ(parse_scan(ply, "a.ply").textures[0].image->name, "a b.png");
}

TEST(Textures, PlyPlacesOfVerticesAndWrongOnes) {
  const auto ply = [](const std::string& comment, const std::string& vertex, const std::string& face,
                      const std::string& body) {
    return parse_scan("ply\nformat ascii 1.0\n" + comment +
                          "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
                          vertex + "element face 2\nproperty list uchar int vertex_indices\n" + face +
                          "end_header\n" + body,
                      "a.ply");
  };
  const std::string file = "comment TextureFile a.png\n", st = "property float s\nproperty float t\n";
  const std::string body = "0 0 0 .1 .2\n1 0 0 .3 .4\n0 1 0 .5 .6\n3 0 1 2\n3 2 1 0\n";
  const RawScan scan = ply(file, st, "", body);
  ASSERT_EQ(scan.face_textures.size(), 2u);
  EXPECT_EQ(scan.face_textures[1].corners, (Uvs{{{.5f, .6f}, {.3f, .4f}, {.1f, .2f}}}));
  EXPECT_TRUE(scan.properties.empty());
  // Without a texture s and t are two properties among others.
  EXPECT_EQ(ply("", st, "", body).properties.size(), 2u);
  EXPECT_TRUE(ply("", st, "", body).textures.empty());
  const std::string bare = "0 0 0\n1 0 0\n0 1 0\n",
                    of_face = "property list uchar float texcoord\nproperty int texnumber\n";
  const RawScan wrong = ply(file, "", of_face, bare + "3 0 1 2 4 0 0 1 1 0\n3 2 1 0 6 0 0 1 1 0 1 1\n");
  for (const FaceTexture& face : wrong.face_textures) EXPECT_EQ(face.texture, FaceTexture::kNone);
  EXPECT_EQ(wrong.notes, std::vector<std::string>{"2 faces have no place in a texture that the file names"});
  EXPECT_TRUE(ply(file, "", of_face, bare + "3 0 1 2 0 -1\n3 2 1 0 0 -1\n").notes.empty());
  EXPECT_EQ(ply(file, "", "", bare + "3 0 1 2\n3 2 1 0\n").notes,
            std::vector<std::string>{"it names textures, but has no texture coordinates"});
}

TEST_F(TextureFiles, MaterialsOfObj) {
  const auto maps = read_obj_materials(
      "# c\nnewmtl one two \nmap_Kd -blendu on -mm 0 1 -o 0.5 -s 2 3 4 -texres 512 my image.png \r\nnewmtl "
      "b\n"
      "map_Kd \"quoted.png\"\nnewmtl c\nmap_Kd -clamp on\nmap_Bump b.png\nnewmtl d\nmap_kd -clamp on d.png",
      "m.mtl");
  ASSERT_EQ(maps.size(), 3u);
  EXPECT_EQ(maps.at("one two").image, "my image.png");
  EXPECT_EQ(maps.at("one two").scale, (std::array{2.0, 3.0}));
  EXPECT_EQ(maps.at("one two").offset, (std::array{0.5, 0.0}));
  EXPECT_EQ(maps.at("b").image, "quoted.png");
  EXPECT_EQ(maps.at("d").wrap, TextureWrap::kClamp);
}

TEST_F(TextureFiles, WhatLiesBeside) {
  const std::string scan = put("a/scan.obj", "");
  put("a/t.png", "");
  put("a/sub/u.png", "");
  put("out.png", "");
  const std::string a = (folder_ / "a").string();
  const auto found = [&](const std::string& name) { return find_beside(scan, name).value_or(""); };
  EXPECT_EQ(found("t.png"), a + "/t.png");
  EXPECT_EQ(found("sub\\u.png"), a + "/sub/u.png");
  EXPECT_EQ(found("u.png"), "");
  EXPECT_EQ(found("D:\\x\\t.png"), a + "/t.png");
  EXPECT_EQ(found("D:t.png"), a + "/t.png");
  EXPECT_EQ(found("/etc/passwd"), "");
  EXPECT_EQ(found("../out.png"), "");
  EXPECT_EQ(found("sub"), "");
  EXPECT_EQ(found(""), "");
  EXPECT_EQ(found(".."), "");
  EXPECT_EQ(found(std::string("t.png\0x", 7)), "");
  EXPECT_EQ(find_beside("-", "t.png"), std::nullopt);
}

TEST(Textures, GltfTransformsAndWraps) {
  const TexturedBall ball(2);
  const double turn = M_PI / 2;
  const RawScan scan = parse_scan(
      ball.glb(
          {{"wrapS", 33071}, {"wrapT", 33648}},
          {{"extensions",
            {{"KHR_texture_transform", {{"offset", {0.25, 0.5}}, {"rotation", turn}, {"scale", {2, 3}}}}}}}),
      "a.glb");
  ASSERT_EQ(scan.face_textures.size(), scan.triangles.size());
  EXPECT_EQ(scan.textures[0].wrap_u, TextureWrap::kClamp);
  EXPECT_EQ(scan.textures[0].wrap_v, TextureWrap::kMirror);
  const auto place = ball.places[ball.quads[0][1].place];
  const auto at = scan.face_textures[0].corners[1];
  // By a quarter, (u, v down) becomes (v, -u), as the extension's text has it.
  EXPECT_NEAR(at[0], 3 * (1 - place[1]) + 0.25f, 1e-5);
  EXPECT_NEAR(1 - at[1], -2 * place[0] + 0.5f, 1e-5);
}

/// Two triangles, the unit square in x and y, with u and v the same.
Scan square(const std::vector<Color8>& texels, std::uint32_t width, std::uint32_t height) {
  Scan scan;
  scan.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  scan.triangles = {{0, 1, 2}, {0, 2, 3}};
  TextureImage image;
  image.width = width;
  image.height = height;
  image.texels = texels;
  scan.textures = {{.image = std::make_shared<const TextureImage>(image)}};
  scan.face_textures = {{0, {{{0, 0}, {1, 0}, {1, 1}}}}, {0, {{{0, 0}, {1, 1}, {0, 1}}}}};
  return scan;
}

TEST(TextureSampler, TexelsLieWhereTheyShouldAndRowsFromTheTop) {
  const Scan scan = square({{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}}, 2, 2);
  const TextureSampler sampler(scan);
  // (x, y) = (0.75, 0.25) is right and below: white. (0.75, 0.25) = 0.25 a + 0.5 b + 0.25 c of face 0.
  const Vec3f white = *sampler.color(0, {0.25f, 0.5f, 0.25f}, 0);
  EXPECT_NEAR(white.x, 1, 1e-6);
  EXPECT_NEAR(white.y, 1, 1e-6);
  const Vec3f red = *sampler.color(1, {0.25f, 0.25f, 0.5f}, 0);  // (0.25, 0.75): left and above
  EXPECT_NEAR(red.x, 1, 1e-6);
  EXPECT_NEAR(red.z, 0, 1e-6);
  // The mean of all in linear light, where all is covered.
  const Vec3f mean = *sampler.color(0, {0.3f, 0.3f, 0.4f}, 10);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c], 0.5f, 0.005f);
}

TEST(TextureSampler, WrapsAndDegeneratePlaces) {
  const std::vector<Color8> row = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}};
  Scan scan = square(row, 4, 1);
  const auto at = [&](float u, TextureWrap wrap) {
    scan.textures[0].wrap_u = wrap;
    scan.face_textures[0].corners.fill({u, 0.5f});  // all corners at one place
    return *TextureSampler(scan).color(0, {0.2f, 0.3f, 0.5f}, 0.5f);
  };
  for (const float whole : {-6.0f, -1.0f, 0.0f, 2.0f, 1e6f}) {
    EXPECT_NEAR(at(whole + 0.125f, TextureWrap::kRepeat).x, 1, whole > 100 ? 0.1 : 1e-4) << whole;
    EXPECT_NEAR(at(whole + 0.875f, TextureWrap::kRepeat).x, 1, whole > 100 ? 0.1 : 1e-4) << whole;
  }
  EXPECT_NEAR(at(1.125f, TextureWrap::kMirror).z, 1, 1e-5);
  EXPECT_NEAR(at(1.125f, TextureWrap::kMirror).x, 1, 1e-5);
  EXPECT_NEAR(at(-0.375f, TextureWrap::kMirror).y, 1, 1e-5);
  EXPECT_EQ(at(-9, TextureWrap::kClamp), (Vec3f{1, 0, 0}));
  EXPECT_EQ(at(1e30f, TextureWrap::kClamp), (Vec3f{1, 1, 1}));
  for (const float wild : {1e30f, -3e38f, 3e38f}) EXPECT_TRUE(is_finite(at(wild, TextureWrap::kRepeat)));
  scan.face_textures[0].texture = FaceTexture::kNone;
  EXPECT_FALSE(TextureSampler(scan).color(0, {1, 0, 0}, 0));
}

TEST(TextureSampler, SmallerVersionsKeepTheMean) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  for (int round = 0; round < 20; ++round) {
    const auto width = static_cast<std::uint32_t>(1 + random() % 33),
               height = static_cast<std::uint32_t>(1 + random() % 33);
    std::vector<Color8> texels(std::size_t{width} * height);
    Vec3f mean{};
    for (Color8& c : texels) {
      c = {static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random()), 128};
      mean = mean + linear_color(c) * (1 / static_cast<float>(texels.size()));
    }
    const Scan scan = square(texels, width, height);
    const TexturePyramid pyramid = make_pyramid(scan.textures[0].image);
    EXPECT_EQ(pyramid.levels.back().width * pyramid.levels.back().height, 1u);
    const Vec3f last = linear_color(*pyramid.levels.back().texels);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(last[c], mean[c], 0.01f) << width << " x " << height;
  }
}

TEST(TextureSampler, MultipliesColoursWhereItIsToldTo) {
  Scan scan = square({{128, 128, 128}}, 1, 1);
  scan.colors.assign(4, {128, 255, 0});
  EXPECT_NEAR(TextureSampler(scan).color(0, {1, 0, 0}, 0)->y, srgb_to_linear(128 / 255.0f), 1e-5);
  scan.textures[0].times_colors = true;
  const Vec3f product = *TextureSampler(scan).color(0, {1, 0, 0}, 0);
  EXPECT_NEAR(product.x, std::pow(srgb_to_linear(128 / 255.0f), 2), 1e-5);
  EXPECT_NEAR(product.z, 0, 1e-6);
}

TEST_F(TextureFiles, WhatIsOverTheBudgetIsLeft) {
  put("ball.png", TexturedBall::png());
  put("ball.mtl", TexturedBall::mtl());
  const std::string path = put("ball.obj", TexturedBall(2).obj());
  const std::string bytes = TexturedBall(2).obj();
  const auto load = [&](std::uint64_t budget) {
    RawScan scan = parse_scan(bytes, path);
    load_textures(scan, path, {budget});
    return scan;
  };
  const std::uint64_t needed = TexturedBall::png().size() + 5 * TexturedBall::kWidth * TexturedBall::kHeight;
  EXPECT_EQ(load(needed).textures.size(), 1u);
  EXPECT_TRUE(load(needed).texture_faults.empty());
  for (const std::uint64_t budget : {needed - 1, std::uint64_t{1000}}) {
    const RawScan scan = load(budget);
    EXPECT_TRUE(scan.textures.empty() && scan.face_textures.empty());
    ASSERT_EQ(scan.texture_faults.size(), 1u);
    EXPECT_EQ(scan.texture_faults[0].find("48 faces have lost their textures: 'ball.png' is over the memory"),
              0u)
        << scan.texture_faults[0];
  }
}

/// Ill-made images: each prefix, and bytes changed, are an image or cost the texture.
TEST_F(TextureFiles, DamagedImages) {
  put("ball.mtl", TexturedBall::mtl());
  const std::string path = put("ball.obj", TexturedBall(1).obj()), bytes = TexturedBall(1).obj();
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  const std::string png = TexturedBall::png();
  for (int round = 0; round < 60; ++round) {
    std::string damaged = png;
    for (int i = 0; i < 3; ++i) damaged[random() % damaged.size()] = static_cast<char>(random());
    if (round % 2 == 0) damaged.resize(random() % damaged.size());
    put("ball.png", damaged);
    RawScan scan = parse_scan(bytes, path);
    load_textures(scan, path, {});
    EXPECT_EQ(scan.textures.empty(), !scan.texture_faults.empty());
    for (const Texture& texture : scan.textures)
      EXPECT_EQ(texture.image->texels.size(), std::size_t{texture.image->width} * texture.image->height);
  }
}

TEST_F(TextureFiles, CleaningAndTurningMoveThemAlong) {
  put("ball.png", TexturedBall::png());
  put("ball.mtl", TexturedBall::mtl());
  const TexturedBall ball(3);
  // Some vertices and faces that go: a face twice, one without area, a point far off the end of the list.
  const std::string obj = ball.obj() + "v 9 9 9\nf 1/1 2/2 1/1\nf 1/1 2/2 3/3\n";
  RawScan raw = read_scan(put("ball.obj", obj));
  const RawScan before = raw;
  IngestReport counts;
  IngestConfig config;
  config.flip_normals = true;
  const Scan scan = ingest(std::move(raw), "a", config, counts);
  ASSERT_EQ(scan.face_textures.size(), scan.triangles.size());
  // By its corners' positions each face still has the places it had.
  std::size_t found = 0;
  for (std::size_t f = 0; f < scan.triangles.size(); ++f)
    for (std::size_t g = 0; g < before.triangles.size(); ++g) {
      bool same = true;
      for (std::size_t c = 0; c < 3; ++c)
        same &= scan.positions[scan.triangles[f][c]] ==
                    Vec3f(before.positions[before.triangles[g][(3 - c) % 3]]) &&
                scan.face_textures[f].corners[c] == before.face_textures[g].corners[(3 - c) % 3];
      found += same;
    }
  EXPECT_GE(found, scan.triangles.size());
}

}  // namespace
}  // namespace rbvh
