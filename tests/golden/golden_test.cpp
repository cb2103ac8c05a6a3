// Pictures of a small scene against those in this folder: they catch what no figure shows (a mirrored image,
// a missing light, a hole). README.md says what each covers. After a change that is meant to be visible, look
// at the new ones and renew them:
//
//   RBVH_RENEW_GOLDEN=1 build/release/tests/golden_test
#include <OpenImageIO/imageio.h>

#include <cmath>
#include <cstdlib>

#include "tests/run_tool.h"

namespace rbvh {
namespace {

// Devices differ in the last bits, and with them a pixel at the silhouette, a tile's border, a
// quantised height: a few pixels may be anything, all others a few of 255 steps off. Kernels built without
// contraction to FMA differed in up to 2 pixels and by a mean of 0.016. What has to be beyond the limits:
// see SeesWhatItIsThereFor.
constexpr int kSteps = 6;            // of 255
constexpr std::size_t kMostOff = 9;  // pixels beyond that, of 96 x 96
constexpr double kMostMean = 0.4;    // steps, over the pixels that either covers

constexpr const char* kAll[] = {"exact.png",  "look.png",       "pair.png",
                                "normal.png", "difference.png", "discs.png"};

struct Picture {
  int width = 0, height = 0;
  std::vector<unsigned char> pixels;  // R G B A
};

Picture read_picture(const std::string& path) {
  const auto in = OIIO::ImageInput::open(path);
  if (!in) return {};
  const int channels = in->spec().nchannels;
  Picture p{in->spec().width, in->spec().height, {}};
  p.pixels.resize(static_cast<std::size_t>(p.width * p.height) * 4, 255);
  if (channels < 3 || channels > 4 ||
      !in->read_image(0, 0, 0, channels, OIIO::TypeDesc::UINT8, p.pixels.data(), 4))
    return {};
  return p;
}

// What differs, in words; empty: nothing relevant.
std::string difference(const Picture& a, const Picture& b) {
  if (a.pixels.empty() || b.pixels.empty()) return "not both can be read";
  if (a.width != b.width || a.height != b.height) return "another size";
  std::size_t off = 0, covered = 0;
  double sum = 0;
  std::string first;
  for (std::size_t i = 0; i < a.pixels.size(); i += 4) {
    if (a.pixels[i + 3] == 0 && b.pixels[i + 3] == 0) continue;
    int most = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const int d = std::abs(a.pixels[i + c] - b.pixels[i + c]);
      most = std::max(most, d);
      sum += d / 4.0;
    }
    ++covered;
    if (most <= kSteps) continue;
    if (++off == 1) {
      const auto width = static_cast<std::size_t>(a.width);
      first = " (the first at " + std::to_string(i / 4 % width) + "," + std::to_string(i / 4 / width) + ")";
    }
  }
  const double mean = covered ? sum / static_cast<double>(covered) : 0;
  if (off <= kMostOff && mean <= kMostMean) return {};
  return std::to_string(off) + " of " + std::to_string(covered) + " pixels differ by more than " +
         std::to_string(kSteps) + " of 255" + first + ", the mean difference is " + std::to_string(mean);
}

// Pictures as `render` makes them; at 96 x 96 each is a few kB.
class Golden : public ToolTest {
 protected:
  static constexpr const char* kSize = " --resolution 96,96 -f -q ";
  static constexpr const char* kPlain =
      " --quick --camera-azimuth-angle 30 --camera-elevation-angle 20 --resolution 96,96 -f -q ";

  void good(const std::string& words) {
    const ToolRun run = tool(words);
    ASSERT_EQ(run.code, 0) << words << "\n" << run.err;
  }

  // A coloured slab with a square hole, a large bumpy ball standing on one of its corners and a small one
  // beside it, +Y up: no two directions, sides or colours are alike.
  void write_scene() {
    std::string vertices, faces;
    std::size_t vertex_count = 0, face_count = 0;
    const auto vertex = [&](double x, double y, double z, int r, int g, int b) {
      char line[96];
      std::snprintf(line, sizeof line, "%.6g %.6g %.6g %d %d %d\n", x, y, z, r, g, b);
      vertices += line;
      return vertex_count++;
    };
    const auto face = [&](std::size_t a, std::size_t b, std::size_t c) {
      faces += "3 " + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(c) + "\n";
      ++face_count;
    };
    const auto sheet = [&](int n, int m, auto&& place, auto&& is_there) {
      const std::size_t begin = vertex_count;
      for (int j = 0; j <= m; ++j)
        for (int i = 0; i <= n; ++i) place(static_cast<double>(i) / n, static_cast<double>(j) / m);
      for (int j = 0; j < m; ++j)
        for (int i = 0; i < n; ++i) {
          if (!is_there(i, j)) continue;
          const std::size_t a = begin + static_cast<std::size_t>(j * (n + 1) + i),
                            c = a + static_cast<std::size_t>(n) + 1;
          face(a, c, a + 1);
          face(a + 1, c, c + 1);
        }
    };
    sheet(
        24, 24,
        [&](double s, double t) {
          vertex(3 * s - 1.5, 0, 3 * t - 1.5, static_cast<int>(60 + 195 * s), 120,
                 static_cast<int>(60 + 195 * t));
        },
        [](int i, int j) { return i < 15 || i >= 19 || j < 14 || j >= 18; });
    const auto ball = [&](double x, double y, double z, double radius, double bump, int r, int g, int b) {
      sheet(
          48, 24,
          [&](double s, double t) {
            const double turn = 2 * M_PI * s, polar = M_PI * t;
            const double size =
                radius * (1 + bump * std::sin(5 * turn) * std::sin(4 * polar) * std::sin(polar));
            vertex(x + size * std::sin(polar) * std::cos(turn), y + size * std::cos(polar),
                   z - size * std::sin(polar) * std::sin(turn), r, g, b);
          },
          [](int, int) { return true; });
    };
    ball(-0.4, 0.85, -0.3, 0.8, 0.12, 230, 200, 120);
    ball(0.95, 0.3, -0.6, 0.28, 0, 90, 170, 230);
    write("scene.ply", "ply\nformat ascii 1.0\nelement vertex " + std::to_string(vertex_count) +
                           "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                           "property uchar green\nproperty uchar blue\nelement face " +
                           std::to_string(face_count) +
                           "\nproperty list uchar int vertex_indices\nend_header\n" + vertices + faces);
  }

  // The large ball alone, as points on a spiral with normals and radii: one in 40 is missing.
  void write_cloud() {
    constexpr int kPoints = 3000;
    std::string lines;
    int count = 0;
    for (int i = 0; i < kPoints; ++i) {
      if (i % 40 == 0) continue;
      const double z = 1 - (2 * i + 1.0) / kPoints, turn = 2.399963 * i, ring = std::sqrt(1 - z * z);
      const double x = ring * std::cos(turn), y = ring * std::sin(turn);
      char line[128];
      std::snprintf(line, sizeof line, "%.6g %.6g %.6g %.6g %.6g %.6g 0.045 %d 150 %d\n", x, y, z, x, y, z,
                    static_cast<int>(127 + 120 * x), static_cast<int>(127 + 120 * z));
      lines += line;
      ++count;
    }
    write("cloud.ply", "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) +
                           "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
                           "property float ny\nproperty float nz\nproperty float radius\nproperty uchar red\n"
                           "property uchar green\nproperty uchar blue\nend_header\n" +
                           lines);
  }

  void build() { good("build scene.ply -o scene.rbvh --levels Q2 --hybrid off -f -q"); }

  void expect_golden(const std::string& name) const {
    const std::string golden = RBVH_SOURCE "/tests/golden/" + name;
    if (std::getenv("RBVH_RENEW_GOLDEN") != nullptr) {
      std::filesystem::copy_file(path(name), golden, std::filesystem::copy_options::overwrite_existing);
      std::printf("renewed %s\n", golden.c_str());
      return;
    }
    const std::string what = difference(read_picture(golden), read_picture(path(name)));
    if (what.empty()) return;
    const std::string kept = testing::TempDir() + "golden_" + name;
    std::filesystem::copy_file(path(name), kept, std::filesystem::copy_options::overwrite_existing);
    ADD_FAILURE() << name << ": " << what << "\n  now:    " << kept << "\n  golden: " << golden
                  << "\n  If it is meant to be so, look at both, then renew with RBVH_RENEW_GOLDEN=1.";
  }
};

TEST_F(Golden, ExactMesh) {
  write_scene();
  good(std::string("render scene.ply -o exact.png") + kPlain);
  expect_golden("exact.png");
}

TEST_F(Golden, Look) {
  write_scene();
  good(std::string("render scene.ply -o look.png --grid --axis") + kSize);
  expect_golden("look.png");
}

TEST_F(Golden, Pair) {
  write_scene();
  build();
  good(std::string("render scene.rbvh -o pair.png") + kPlain);
  expect_golden("pair.png");
}

TEST_F(Golden, PairNormals) {
  write_scene();
  build();
  good(std::string("render scene.rbvh -o normal.png --aov normal") + kPlain);
  expect_golden("normal.png");
}

TEST_F(Golden, Difference) {
  write_scene();
  build();
  good("validate scene.rbvh --against scene.ply --views 1 --resolution 96 --pictures . -f -q");
  std::filesystem::rename(path("Q2-0.png"), path("difference.png"));
  expect_golden("difference.png");
}

TEST_F(Golden, Discs) {
  write_cloud();
  good(std::string("render cloud.ply -o discs.png") + kPlain);
  expect_golden("discs.png");
}

// The limits themselves: each of these changes must be caught in every picture.
TEST_F(Golden, SeesWhatItIsThereFor) {
  for (const char* name : kAll) {
    const Picture p = read_picture(std::string(RBVH_SOURCE "/tests/golden/") + name);
    ASSERT_EQ(p.width, 96) << name;
    ASSERT_EQ(p.height, 96) << name;
    EXPECT_EQ(difference(p, p), "") << name;
    EXPECT_LT(std::filesystem::file_size(std::string(RBVH_SOURCE "/tests/golden/") + name), 20'000u) << name;
    const auto changed = [&](auto&& source_of, auto&& change) {
      Picture q = p;
      for (int y = 0; y < 96; ++y)
        for (int x = 0; x < 96; ++x)
          for (int c = 0; c < 4; ++c) {
            const auto [from_x, from_y, from_c] = source_of(x, y, c);
            const auto at = static_cast<std::size_t>((y * 96 + x) * 4 + c);
            q.pixels[at] =
                change(x, y, c, p.pixels[static_cast<std::size_t>((from_y * 96 + from_x) * 4 + from_c)]);
          }
      return difference(p, q);
    };
    const auto keep = [](int, int, int, unsigned char v) { return v; };
    const auto same = [](int x, int y, int c) { return std::array{x, y, c}; };
    EXPECT_NE(changed([](int x, int y, int c) { return std::array{95 - x, y, c}; }, keep), "") << name;
    EXPECT_NE(changed([](int x, int y, int c) { return std::array{x, 95 - y, c}; }, keep), "") << name;
    EXPECT_NE(changed(
                  [](int x, int y, int c) {
                    return std::array{std::max(0, x - 1), y, c};
                  },
                  keep),
              "")
        << name;
    EXPECT_NE(changed(
                  [](int x, int y, int c) {
                    return std::array{x, y, c == 0 ? 2 : c == 2 ? 0 : c};
                  },
                  keep),
              "")
        << name;
    EXPECT_NE(
        changed(same,
                [](int, int, int c, unsigned char v) {
                  return static_cast<unsigned char>(c < 3 ? v * 0.95 : v);  // sRGB: a tenth of the light
                }),
        "")
        << name;
    EXPECT_NE(changed(same,
                      [](int x, int y, int, unsigned char v) {
                        return x / 4 == 11 && y / 4 == 11 ? static_cast<unsigned char>(0) : v;
                      }),
              "")
        << name << ": a hole of 4 x 4 pixels";
  }
}

}  // namespace
}  // namespace rbvh
