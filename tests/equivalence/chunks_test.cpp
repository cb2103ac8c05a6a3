// A scan that is built in chunks is the scan that is built whole, but for rounding: nothing shows where the
// chunks meet.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>

#include "io/load_asset.h"
#include "io/parts_file.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/device/device.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/build_in_chunks.h"
#include "rbvh/complete_scan.h"
#include "rbvh/frame.h"
#include "rbvh/io.h"
#include "rbvh/tracer.h"
#include "tests/shapes.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

class ChunksTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "rbvh_chunks_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder = pattern;
    seed = std::random_device{}();
    random.seed(seed);
    RecordProperty("seed", std::to_string(seed));
  }
  void TearDown() override {
    if (HasFailure()) std::printf("seed %u\n", seed);
    fs::remove_all(folder);
  }
  std::string path(const std::string& name) const { return (folder / name).string(); }

  float uniform(float lo, float hi) { return std::uniform_real_distribution<float>(lo, hi)(random); }
  Vec3f direction() {
    for (;;) {
      const Vec3f p{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      const float l = length(p);
      if (l > 0.1f && l < 1) return p * (1 / l);
    }
  }
  static Ray ray(Vec3f from, Vec3f to) {
    const Vec3f d = to - from;
    return {{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, INFINITY};
  }
  /// From outside of a bumpy sphere to points that lie well in it, and to its own corners and edges.
  std::vector<Ray> rays_into(const Scan& sphere, std::size_t count) {
    std::vector<Ray> rays;
    while (rays.size() < count) rays.push_back(ray(direction() * 3.0f, direction() * uniform(0, 0.7f)));
    while (rays.size() < 2 * count) {
      const Vec3f p = sphere.positions[random() % sphere.positions.size()],
                  q = sphere.positions[random() % sphere.positions.size()];
      rays.push_back(ray(p * uniform(1.5f, 3.0f), Vec3f{}));  // through a corner
      rays.push_back(ray(p * 2.0f, p * 0.5f + q * 0.1f));
    }
    return rays;
  }

  void check_levels(const Scan& scan, const BuildConfig& config, const std::vector<Ray>& rays, float holes);

  Device device = Device::open();
  fs::path folder;
  std::mt19937 random;
  unsigned seed = 0;
};

BuildConfig config_of(std::vector<LevelConfig> levels, Hybrid hybrid = Hybrid::kAuto) {
  BuildConfig config;
  config.levels = std::move(levels);
  config.hybrid = hybrid;
  return config;
}

struct Deviation {
  std::size_t misses = 0;
  float mean = 0, most = 0;
};

Deviation compare(const std::vector<Hit>& hits, const std::vector<Hit>& exact) {
  Deviation d;
  double sum = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (exact[i].leaf == RBVH_NO_LEAF) continue;
    if (hits[i].leaf == RBVH_NO_LEAF) {
      ++d.misses;
      continue;
    }
    const float apart = std::abs(hits[i].t - exact[i].t);
    sum += static_cast<double>(apart);
    d.most = std::max(d.most, apart);
  }
  d.mean = static_cast<float>(sum / static_cast<double>(hits.size()));
  return d;
}

/// The level of an asset as rays see it.
std::vector<Hit> cast(const Device& device, const std::string& file, const std::string& level,
                      const std::vector<Ray>& rays) {
  LoadConfig load;
  load.levels = std::vector{level};
  const Asset asset = load_asset(file, load);
  TracerConfig config;
  config.level = level;
  return intersect(*make_tracer(device, asset, config), rays);
}

/// `holes`: of the rays, so many more than in the pair that is built whole.
void ChunksTest::check_levels(const Scan& scan, const BuildConfig& config, const std::vector<Ray>& rays,
                              float holes) {
  write_ply(path("scan.ply"), scan, true);
  const std::string whole = path("whole.rbvh");
  save_pair(whole, build_pair(device, scan, config), true);
  const Asset asset = make_asset(Scan(scan));
  const std::vector<Hit> exact = intersect(*make_tracer(device, asset), rays);
  for (const std::uint32_t chunks : {1u, 2u, 4u, 8u}) {
    const std::string file = path("parts.rbvh");
    const ChunkReport report =
        build_in_chunks(device, {path("scan.ply")}, file, config, {.chunks = chunks, .overwrite = true});
    EXPECT_EQ(report.chunks, chunks);
    for (const LevelConfig& level : config.levels) {
      const Deviation parts = compare(cast(device, file, level.name, rays), exact),
                      one = compare(cast(device, whole, level.name, rays), exact);
      const std::string what = std::to_string(chunks) + " chunks, " + level.name;
      EXPECT_LE(static_cast<float>(parts.misses),
                static_cast<float>(one.misses) + holes * static_cast<float>(rays.size()))
          << what;
      EXPECT_LE(parts.mean, 1.2f * one.mean + 1e-6f) << what;
    }
  }
}

TEST_F(ChunksTest, TrianglesMeetWithoutHoles) {
  const Scan sphere = bumpy_sphere(90);
  check_levels(sphere, config_of(standard_levels()), rays_into(sphere, 4000), 0);
}

TEST_F(ChunksTest, TilesMeetWithoutHoles) {
  const Scan sphere = bumpy_sphere(90);
  check_levels(sphere, config_of({{"Q0", 20e3f, 0.85f, 45, 0}, {"Q1", 4e3f, 0.8f, 50, 0}}, Hybrid::kOff),
               rays_into(sphere, 4000), 0);
}

TEST_F(ChunksTest, CloudsMeetWithoutHoles) {
  Scan cloud;
  for (int i = 0; i < 20000; ++i) {
    const Vec3f d = direction();
    cloud.positions.push_back(d * (1 + 0.05f * std::sin(5 * d.x) * std::sin(4 * d.y)));
    cloud.normals.push_back(d);
  }
  complete_scan(cloud);
  std::vector<Ray> rays;
  while (rays.size() < 8000) rays.push_back(ray(direction() * 3.0f, direction() * uniform(0, 0.7f)));
  check_levels(cloud, config_of(standard_levels({"Q0", "Q2", "Q4"})), rays, 0.0005f);
}

TEST_F(ChunksTest, ColorsAndObjectsAreKept) {
  Scan scan = bumpy_sphere(40);
  scan.colors.resize(scan.positions.size());
  for (std::size_t i = 0; i < scan.colors.size(); ++i)
    scan.colors[i] = scan.positions[i].x > 0 ? Color8{200, 40, 40} : Color8{40, 40, 200};
  for (std::size_t i = 0; i < scan.triangles.size(); ++i)
    scan.object_ids.push_back(scan.positions[scan.triangles[i][0]].y > 0 ? 7 : 3);
  write_ply(path("scan.ply"), scan, true);
  build_in_chunks(device, {path("scan.ply")}, path("a.rbvh"), config_of(standard_levels({"Q1"})),
                  {.chunks = 4});
  std::map<std::uint32_t, int> objects;
  for (const PairPart& part : read_parts(path("a.rbvh")).parts)
    for (const RbvhLeaf& leaf : load_pair(part_path(path("a.rbvh"), part)).levels[0].leaves)
      ++objects[leaf.object_id];
  EXPECT_EQ(objects.size(), 2u);
  EXPECT_TRUE(objects.contains(3) && objects.contains(7));

  const Asset asset = load_asset(path("a.rbvh"));
  const auto tracer = make_tracer(device, asset);
  const std::vector<Ray> rays = {ray({3, 0.1f, 0.1f}, {0.5f, 0, 0}), ray({-3, 0.1f, 0.1f}, {-0.5f, 0, 0})};
  const std::vector<Hit> hits = intersect(*tracer, rays);
  const SurfaceSamples surface = tracer->surface(hits, 0);
  ASSERT_EQ(surface.colors.size(), 2u);
  EXPECT_GT(surface.colors[0].x, 2 * surface.colors[0].z);
  EXPECT_GT(surface.colors[1].z, 2 * surface.colors[1].x);
}

TEST_F(ChunksTest, PartsHaveOneFrame) {
  // Far from the origin, in doubles.
  const Scan sphere = bumpy_sphere(40);
  const Vec3d far{431000.25, 5512000.5, 300};
  std::ofstream out(path("far.ply"), std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << sphere.positions.size()
      << "\nproperty double x\nproperty double y\nproperty double z\nelement face " << sphere.triangles.size()
      << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vec3f& p : sphere.positions) {
    const Vec3d q = Vec3d(p) + far;
    out.write(reinterpret_cast<const char*>(&q), sizeof q);
  }
  for (const Triangle& t : sphere.triangles) {
    out.put(3);
    out.write(reinterpret_cast<const char*>(&t), sizeof t);
  }
  out.close();
  build_in_chunks(device, {path("far.ply")}, path("a.rbvh"), config_of(standard_levels({"Q1"})),
                  {.chunks = 4});
  const Asset parts = load_asset(path("a.rbvh")), exact = load_asset(path("far.ply"));
  EXPECT_EQ(shift(parts), shift(exact));
  EXPECT_EQ(parts.bounds.lo, exact.bounds.lo);
  EXPECT_EQ(parts.bounds.hi, exact.bounds.hi);
  const auto center = static_cast<Vec3f>(far - shift(parts));
  std::vector<Ray> rays;
  for (int i = 0; i < 2000; ++i)
    rays.push_back(ray(center + direction() * 3.0f, center + direction() * 0.5f));
  const Deviation d =
      compare(intersect(*make_tracer(device, parts), rays), intersect(*make_tracer(device, exact), rays));
  EXPECT_EQ(d.misses, 0u);
  EXPECT_LT(d.mean, 1e-3f);
}

TEST_F(ChunksTest, ThreadsDoNotShow) {
  write_ply(path("scan.ply"), bumpy_sphere(60), true);
  std::map<std::string, std::string> bytes[2];
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    build_in_chunks(device, {path("scan.ply")}, path("a.rbvh"), config_of(standard_levels({"Q0", "Q3"})),
                    {.chunks = 3, .overwrite = true});
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file()) {
        std::ifstream in(entry.path(), std::ios::binary);
        bytes[threads == 3][entry.path().string()] = {std::istreambuf_iterator<char>(in), {}};
      }
  }
  set_thread_count(0);
  EXPECT_TRUE(bytes[0] == bytes[1]);
  EXPECT_EQ(bytes[0].size(), 3 + 2 * 3u);  // the scan, the table, the journal, and pairs
}

TEST_F(ChunksTest, PartsLeaveByUse) {
  const Scan sphere = bumpy_sphere(60);
  write_ply(path("scan.ply"), sphere, true);
  build_in_chunks(device, {path("scan.ply")}, path("a.rbvh"), config_of(standard_levels({"Q0"})),
                  {.chunks = 8});
  const std::vector<Ray> rays = rays_into(sphere, 500);
  Asset asset = load_asset(path("a.rbvh"));
  const std::vector<Hit> all = intersect(*make_tracer(device, asset), rays);
  std::uint64_t bytes = 0;
  for (const SceneObject& object : asset.scene()->objects) bytes += object.on_demand()->bytes;
  const SurfaceSamples seen = make_tracer(device, asset)->surface(all, 0);
  // With room for what rays are cast at and a level or two; for neither; and with no file to leave for.
  const char* const folder_before = std::getenv("TMPDIR");
  for (const auto& [part, folder] :
       {std::pair{0.3, "/tmp"}, std::pair{0.05, "/tmp"}, std::pair{0.05, "/none"}}) {
    SCOPED_TRACE(part);
    ::setenv("TMPDIR", folder, 1);
    asset.scene()->resident_bytes = static_cast<std::uint64_t>(static_cast<double>(bytes) * part);
    const auto tracer = make_tracer(device, asset);
    for (int again = 0; again < 2; ++again) {
      const std::vector<Hit> some = intersect(*tracer, rays);
      EXPECT_LE(tracer->memory(), bytes / 2);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        EXPECT_EQ(all[i].t, some[i].t);
        EXPECT_EQ(all[i].leaf, some[i].leaf);
      }
      const SurfaceSamples again_seen = tracer->surface(some, 0);
      for (std::size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(seen.normals[i], again_seen.normals[i]);
    }
  }
  folder_before != nullptr ? ::setenv("TMPDIR", folder_before, 1) : ::unsetenv("TMPDIR");
}

}  // namespace
}  // namespace rbvh
