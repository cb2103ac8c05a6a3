// What is gathered of scans in pieces and cells is what an ingest makes of them as a whole.
#include "chunks/gather_scan.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <sstream>

#include "io/scan_io.h"
#include "pipeline/base/error.h"
#include "pipeline/device/device.h"
#include "pipeline/scan/ingest.h"
#include "rbvh/build_in_chunks.h"
#include "rbvh/frame.h"
#include "rbvh/io.h"
#include "rbvh/tracer.h"
#include "tests/las_file.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

class GatherTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "rbvh_gather_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder = pattern;
    seed = std::random_device{}();
    random.seed(seed);
  }
  void TearDown() override {
    if (HasFailure()) std::printf("seed %u\n", seed);
    fs::remove_all(folder);
  }
  std::string write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder / name, std::ios::binary) << bytes;
    return (folder / name).string();
  }
  /// As the file that is gathered has it.
  Scan gather(const std::vector<std::string>& inputs, std::uint32_t cells = 1) {
    fs::remove_all(folder / "work");
    fs::create_directory(folder / "work");
    gathered = gather_scan(inputs, (folder / "work").string(), {.chunks = cells});
    std::size_t files = 0;
    std::string found;
    for (const auto& entry : fs::directory_iterator(folder / "work")) {
      ++files;
      found = entry.path().string();
    }
    EXPECT_EQ(files, 1u) << "nothing else is left";
    return shift_to_float(read_scan(found));
  }
  static Scan ingested(const std::vector<std::string>& inputs) {
    IngestReport counts;
    return ingest(read_scans(inputs, {}), "", {}, counts);
  }
  float uniform(float lo, float hi) { return std::uniform_real_distribution<float>(lo, hi)(random); }

  fs::path folder;
  std::mt19937 random;
  unsigned seed = 0;
  GatheredScan gathered;
};

std::string words(Vec3f p) {
  char text[96];
  std::snprintf(text, sizeof text, "%.9g %.9g %.9g\n", static_cast<double>(p.x), static_cast<double>(p.y),
                static_cast<double>(p.z));
  return text;
}

/// In the four ways that files have it.
std::vector<std::pair<std::string, std::string>> files_of(const Scan& mesh) {
  const std::string counts[] = {std::to_string(mesh.positions.size()), std::to_string(mesh.triangles.size())};
  const auto header = [&](const std::string& format) {
    return "ply\nformat " + format + " 1.0\nelement vertex " + counts[0] +
           "\nproperty float x\nproperty float y\nproperty float z\nelement face " + counts[1] +
           "\nproperty list uchar int vertex_indices\nend_header\n";
  };
  std::string text = header("ascii"), big = header("binary_big_endian"), obj = "# a comment\n", stl(80, ' ');
  stl += raw(static_cast<std::uint32_t>(mesh.triangles.size()));
  const auto reversed = [](std::string bytes) { return std::string(bytes.rbegin(), bytes.rend()); };
  for (const Vec3f& p : mesh.positions) {
    text += words(p);
    obj += "v " + words(p);
    for (const float c : {p.x, p.y, p.z}) big += reversed(raw(c));
  }
  for (const Triangle& t : mesh.triangles) {
    text += "3";
    obj += "f";
    big += '\3';
    stl += std::string(12, '\0');
    for (const std::uint32_t v : t) {
      text += " " + std::to_string(v);
      // Some count back from the last.
      obj += " " + (v % 3 == 0 ? std::to_string(static_cast<int>(v) - static_cast<int>(mesh.positions.size()))
                               : std::to_string(v + 1));
      big += reversed(raw(v));
      for (int axis = 0; axis < 3; ++axis) stl += raw(mesh.positions[v][axis]);
    }
    text += "\n";
    obj += "\n";
    stl += std::string(2, '\0');
  }
  return {{"text.ply", text}, {"big.ply", big}, {"a.obj", obj}, {"a.stl", stl}};
}

TEST_F(GatherTest, MeshesOfAllFormats) {
  Scan mesh = bumpy_sphere(180);  // pieces are smaller
  mesh.triangles.erase(
      std::remove_if(mesh.triangles.begin(), mesh.triangles.end(),
                     [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }),
      mesh.triangles.end());
  for (const auto& [name, bytes] : files_of(mesh)) {
    const Scan got = gather({write(name, bytes)});
    EXPECT_EQ(gathered.ply.corners_apart, name == "a.stl") << name;
    std::size_t flat = 0, next = 0;
    for (const Triangle& t : mesh.triangles) {
      const Vec3f a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
      if (name == "a.stl" && (a == b || b == c || c == a)) {
        ++flat;
        continue;
      }
      ASSERT_LT(next, got.triangles.size()) << name;
      const Triangle& own = got.triangles[next++];
      ASSERT_TRUE(got.positions[own[0]] == a && got.positions[own[1]] == b && got.positions[own[2]] == c)
          << name << " " << next;
    }
    EXPECT_EQ(next, got.triangles.size()) << name;
    EXPECT_EQ(gathered.notes.empty(), flat == 0) << name;
  }
}

// Concave ones, in planes of any direction, some with a corner that is not finite or that is there twice.
TEST_F(GatherTest, PolygonsAreCutAsInMemory) {
  std::string obj, text, list;
  std::size_t vertices = 0, faces = 0;
  for (int polygon = 0; polygon < 500; ++polygon) {
    const auto corners = static_cast<std::size_t>(3 + random() % 9);
    const Vec3f u{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)},
        v{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    std::string face;
    for (std::size_t i = 0; i < corners; ++i) {
      const float angle = 6.2831853f * static_cast<float>(i) / static_cast<float>(corners);
      const float radius = uniform(0.1f, 1);
      const Vec3f p = (u * std::cos(angle) + v * std::sin(angle)) * radius;
      const std::string place = random() % 400 == 0 ? "nan 0 0\n" : words(p);
      obj += "v " + place;
      text += place;
      const std::size_t corner = vertices + (i > 0 && random() % 50 == 0 ? i - 1 : i);
      face += " " + std::to_string(corner);
    }
    vertices += corners;
    ++faces;
    list += std::to_string(corners) + face + "\n";
    std::string numbers = "f";
    std::istringstream in(face);
    for (std::size_t k = 0; in >> k;) numbers += " " + std::to_string(k + 1);
    obj += numbers + "\n";
  }
  const std::string ply = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(vertices) +
                          "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                          std::to_string(faces) + "\nproperty list uchar int vertex_indices\nend_header\n" +
                          text + list;
  for (const std::string& file : {write("polygons.obj", obj), write("polygons.ply", ply)}) {
    const RawScan whole = read_scan(file);
    std::vector<Triangle> wanted;
    for (const Triangle& t : whole.triangles) {
      bool stays = t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
      for (const std::uint32_t corner : t) stays = stays && is_finite(whole.positions[corner]);
      if (stays) wanted.push_back(t);
    }
    EXPECT_EQ(gather({file}).triangles, wanted) << file;
  }
}

TEST_F(GatherTest, SeveralMeshesAreObjects) {
  const auto files = files_of(bumpy_sphere(10));
  std::vector<std::string> inputs;
  for (const auto& [name, bytes] : files) inputs.push_back(write(name, bytes));
  const Scan got = gather(inputs), whole = ingested(inputs);
  std::set<std::int32_t> ids(got.object_ids.begin(), got.object_ids.end()),
      of_whole(whole.object_ids.begin(), whole.object_ids.end());
  EXPECT_EQ(ids, of_whole);
  EXPECT_EQ(got.object_ids.size(), got.triangles.size());
}

TEST_F(GatherTest, WhatCannotBeIsRefused) {
  auto files = files_of(bumpy_sphere(10));
  const auto refused = [&](const std::vector<std::string>& inputs, const std::string& words) {
    try {
      gather(inputs);
      ADD_FAILURE() << words;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  const std::string cloud = write("cloud.las", LasFile{.points = {{1, 2, 3}, {2, 5, 3}, {4, 1, 9}}}.bytes());
  refused({write("a.obj", files[2].second), cloud}, "a mesh and a cloud");
  refused({write("b.obj", files[2].second + "f 1 2 9999\n")}, "out of range");
  refused({write("c.obj", files[2].second + "v 1 2\n")}, "line " + std::to_string(1 + 121 + 200 + 1));
  refused({write("cut.ply", files[0].second.substr(0, files[0].second.size() - 40))},
          "the file is cut in face");
  refused({write("cut.ply", files[1].second.substr(0, files[1].second.size() - 40))},
          "the file is cut in face");
  refused({write("cut.ply", files[1].second.substr(0, 600))}, "the file is cut in vertex");
  std::string wrong = files[0].second;
  wrong.replace(wrong.rfind("\n3 ") + 1, 2, "3 x");
  refused({write("wrong.ply", wrong)}, "line " + std::to_string(9 + 121 + 200));
}

/// Terrain, and a ball above it, in tiles that meet.
std::vector<LasFile> tiles_of(std::mt19937& random, int count) {
  std::vector<LasFile> tiles(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto add = [&](double x, double y, double z) {
    tiles[(x > 0 ? 1u : 0u) + (y > 0 ? 2u : 0u)].points.push_back({static_cast<std::int32_t>(x * 1e5),
                                                                   static_cast<std::int32_t>(y * 1e6),
                                                                   static_cast<std::int32_t>(z * 2e3)});
  };
  for (int i = 0; i < count; ++i) {
    const double x = uniform(random), y = uniform(random);
    add(x, y, 0.1 * std::sin(5 * x) * std::sin(4 * y));
  }
  for (int i = 0; i < count / 2; ++i) {
    const double z = uniform(random), angle = 3.14159265 * uniform(random), r = std::sqrt(1 - z * z);
    add(0.3 * r * std::cos(angle), 0.3 * r * std::sin(angle), 0.6 + 0.3 * z);
  }
  return tiles;
}

TEST_F(GatherTest, CloudsAreCompletedAcrossCells) {
  std::vector<std::string> inputs;
  std::vector<LasFile> tiles = tiles_of(random, 40000);
  tiles[0].points.push_back(tiles[0].points[7]);  // of the same file
  for (std::size_t i = 0; i < tiles.size(); ++i)
    inputs.push_back(write(std::to_string(i) + ".las", tiles[i].bytes()));
  const Scan whole = ingested(inputs);
  for (const std::uint32_t cells : {1u, 7u, 20u}) {
    const Scan got = gather(inputs, cells);
    ASSERT_EQ(got.positions.size(), whole.positions.size());
    EXPECT_EQ(got.shift, whole.shift);
    EXPECT_EQ(got.object_ids, whole.object_ids);
    std::size_t turned = 0, tilted = 0, resized = 0;
    for (std::size_t i = 0; i < got.positions.size(); ++i) {
      ASSERT_EQ(got.positions[i], whole.positions[i]) << i;
      const float cosine = dot(got.normals[i], whole.normals[i]);
      turned += cosine < 0;
      tilted += std::abs(cosine) < 0.9999f;
      resized += std::abs(got.radii[i] / whole.radii[i] - 1) > 1e-3f;
    }
    const std::size_t few = cells == 1 ? 0 : got.positions.size() / 1000;
    EXPECT_LE(turned, few) << cells;
    EXPECT_LE(tilted, few) << cells;
    EXPECT_LE(resized, few) << cells;
  }
}

TEST_F(GatherTest, TilesAreOneSurface) {
  std::vector<std::string> inputs;
  const std::vector<LasFile> tiles = tiles_of(random, 10000);
  for (std::size_t i = 0; i < tiles.size(); ++i)
    inputs.push_back(write(std::to_string(i) + ".las", tiles[i].bytes()));
  const Device device = Device::open();
  BuildConfig config;
  config.levels = standard_levels({"Q0", "Q3"});
  const std::string parts = (folder / "parts.rbvh").string(), whole = (folder / "whole.rbvh").string();
  const ChunkReport report = build_in_chunks(device, inputs, parts, config, {.chunks = 7});
  EXPECT_EQ(report.chunks, 7u);
  EXPECT_FALSE(report.notes.empty());
  save_pair(whole, build_pair(device, ingested(inputs), config), true);
  const Vec3d own = shift(load_asset(whole)), origin{500000.25, 5400000.5, -10};
  EXPECT_EQ(shift(load_asset(parts)), own);
  std::vector<Ray> rays;
  for (int i = 0; i < 8000; ++i) {
    const float x = uniform(-950, 950), y = uniform(-950, 950);
    const Vec3f from{x, y, 3000}, to{x + uniform(-9, 9), y, -3000};
    const auto move = static_cast<Vec3f>(origin - own);
    const Vec3f p = from + move, d = to - from;
    rays.push_back({{p.x, p.y, p.z}, 0, {d.x, d.y, d.z}, INFINITY});
  }
  for (const char* level : {"Q0", "Q3"}) {
    const auto cast = [&](const std::string& file) {
      LoadConfig load;
      load.levels = std::vector<std::string>{level};
      TracerConfig tracer;
      tracer.level = level;
      return intersect(*make_tracer(device, load_asset(file, load), tracer), rays);
    };
    const std::vector<Hit> of_parts = cast(parts), of_whole = cast(whole);
    std::size_t missed = 0, missed_whole = 0, apart = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      missed += of_parts[i].leaf == RBVH_NO_LEAF;
      missed_whole += of_whole[i].leaf == RBVH_NO_LEAF;
      apart += std::abs(of_parts[i].t - of_whole[i].t) * 6000 > 30;
    }
    EXPECT_LE(missed, missed_whole + rays.size() / 1000) << level;
    EXPECT_LE(missed_whole, rays.size() / 100) << level;
    EXPECT_LE(apart, rays.size() / 200) << level;
  }
}

}  // namespace
}  // namespace rbvh
