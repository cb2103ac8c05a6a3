// A pair that is updated is as one built of the changed scan.
#include "rbvh/update.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <random>

#include "io/rbvh_file.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/rbvh/build.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/clip_triangles.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_sampling.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/level_mesh.h"
#include "pipeline/rbvh/level_surface.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/error.h"
#include "rbvh/measure.h"
#include "rbvh/tracer.h"
#include "tests/shapes.h"
#include "tests/trace_test.h"

namespace rbvh {
namespace {

/// A sphere without a gap at its seam.
Scan sphere(int n, float bump = 0.05f, float scale = 1) {
  Scan scan = bumpy_sphere(n, bump);
  const auto side = static_cast<std::uint32_t>(n) + 1;
  for (std::uint32_t j = 0; j < side; ++j) scan.positions[j * side + side - 1] = scan.positions[j * side];
  for (Vec3f& p : scan.positions) p = p * scale;
  return scan;
}

Scan join(const Scan& a, const Scan& b) {
  Scan both = a;
  const auto first = static_cast<std::uint32_t>(a.positions.size());
  both.positions.insert(both.positions.end(), b.positions.begin(), b.positions.end());
  for (const Triangle& t : b.triangles) both.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return both;
}

Scan clipped(Scan scan, const Bounds3d& box, BoxSide side) {
  clip_triangles(scan, box, side, {});
  return scan;
}

class UpdateTest : public TraceTest {
 protected:
  Device device = Device::open();

  Asset built(const Scan& scan, const BuildConfig& config) const { return build_pair(device, scan, config); }

  Bounds3d random_box(float most) {
    std::uniform_real_distribution<double> size(0.1, static_cast<double>(most));
    std::normal_distribution<double> place;
    const Vec3d center = normalized(Vec3d{place(random), place(random), place(random)}),
                half{size(random), size(random), size(random)};
    return {center - half, center + half};
  }

  void expect_whole(const Asset& pair) const {
    const auto fault = find_fault(*pair.rbvh());
    EXPECT_FALSE(fault) << *fault;
    const auto texel_fault = find_texel_fault(*pair.rbvh());
    EXPECT_FALSE(texel_fault) << *texel_fault;
  }

  /// Of rays along the normals at random points of the mesh that lie farther than `margin` from the box's
  /// faces: the farthest from the level, and how many miss it.
  struct Along {
    float farthest = 0;
    int misses = 0, rays = 0;
  };
  Along cast_along_normals(const Asset& pair, const std::string& level, const Scan& exact,
                           const Bounds3d* box, double margin, float reach) {
    std::uniform_real_distribution<float> weight(0, 1);
    std::vector<Ray> rays;
    for (const Triangle& t : exact.triangles) {
      const Vec3f a = exact.positions[t[0]], b = exact.positions[t[1]], c = exact.positions[t[2]];
      const Vec3f n = cross(b - a, c - a);
      if (!(length(n) > 1e-5f)) continue;
      float u = weight(random), v = weight(random);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      const Vec3f p = a + (b - a) * u + (c - a) * v;
      if (box != nullptr) {
        const Vec3d m{margin, margin, margin}, q(p);
        if (contains({box->lo - m, box->hi + m}, q) && !contains({box->lo + m, box->hi - m}, q)) continue;
      }
      const Vec3f up = normalized(n), from = p + up * reach;
      Ray ray{};
      std::copy_n(&from.x, 3, ray.origin);
      const Vec3f down = -up;
      std::copy_n(&down.x, 3, ray.direction);
      ray.tmin = 0;
      ray.tmax = 2 * reach;
      rays.push_back(ray);
    }
    TracerConfig config;
    config.level = level;
    const std::unique_ptr<Tracer> tracer = make_tracer(device, pair, config);
    Along along;
    along.rays = static_cast<int>(rays.size());
    for (const Hit& hit : cast(*tracer, rays)) {
      if (!is_hit(hit))
        ++along.misses;
      else
        along.farthest = std::max(along.farthest, std::abs(hit.t - reach));
    }
    return along;
  }
};

BuildConfig coarse(std::initializer_list<float> errors, Hybrid hybrid = Hybrid::kAuto) {
  BuildConfig config{.levels = {}, .hybrid = hybrid};
  for (const float error : errors) {
    LevelConfig level = level_of_error(static_cast<double>(error));
    level.name = "L" + std::to_string(config.levels.size());
    config.levels.push_back(level);
  }
  return config;
}

/// What a leaf shows, whatever its number and its place in the atlas.
using LeafKey = std::vector<std::uint32_t>;
LeafKey leaf_key(const Level& level, std::uint32_t leaf, std::uint32_t first, const RbvhNode& node) {
  LeafKey key;
  const auto add = [&](const float* values, int count) {
    for (int i = 0; i < count; ++i) key.push_back(std::bit_cast<std::uint32_t>(values[i]));
  };
  const RbvhLeaf& own = level.leaves[leaf];
  key.insert(key.end(), {own.width, own.height, own.primitives, own.object_id});
  add(node.lo, 3);
  add(node.hi, 3);
  add(own.to_tile, 12);
  if (first == RBVH_NO_LEAF) {
    for (const Layer& layer : level.layers)
      for (std::uint32_t y = 0; y < own.height; ++y)
        for (std::uint32_t x = 0; x < own.width; ++x)
          key.push_back(layer.texels[std::size_t{own.y + y} * level.atlas_width + own.x + x]);
    return key;
  }
  for (std::uint32_t i = first; i < first + own.primitives; ++i) {
    Triangle t = primitive_corners(level.primitives, i);
    // Which corner comes first is the codec's.
    std::array<Vec3f, 3> corners = {level.primitives.positions[t[0]], level.primitives.positions[t[1]],
                                    level.primitives.positions[t[2]]};
    std::rotate(
        corners.begin(),
        std::min_element(corners.begin(), corners.end(),
                         [](Vec3f a, Vec3f b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); }),
        corners.end());
    for (const Vec3f& p : corners) add(&p.x, 3);
    if (holds_discs(level)) add(&level.primitives.radii[i], 1);
  }
  return key;
}

/// The leaves whose boxes do not meet the given one.
std::map<LeafKey, int> leaves_beside(const Level& level, const Bounds3d& box) {
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  std::map<LeafKey, int> keys;
  for (const RbvhNode& node : level.nodes)
    if (node.count == 1 &&
        !overlap(Bounds3d{{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}}, box))
      ++keys[leaf_key(level, node.first, firsts[node.first], node)];
  return keys;
}

void expect_unchanged_beside(const Asset& before, const Asset& after, const Bounds3d& box) {
  for (std::size_t i = 0; i < before.rbvh()->levels.size(); ++i) {
    const std::map<LeafKey, int> now = leaves_beside(after.rbvh()->levels[i], box);
    std::size_t missing = 0;
    for (const auto& [key, count] : leaves_beside(before.rbvh()->levels[i], box))
      if (const auto found = now.find(key); found == now.end() || found->second < count) ++missing;
    EXPECT_EQ(missing, 0u) << before.rbvh()->levels[i].name;
  }
}

TEST_F(UpdateTest, ABoxOfAnotherShapeIsWhatTheNewScanHasThere) {
  const Scan old_scan = sphere(48), new_scan = sphere(64, 0.07f, 1.12f);
  for (const BuildConfig& config : {coarse({2e-4f, 2e-3f}), coarse({1e-3f}, Hybrid::kOff), coarse({1e-3f})}) {
    for (int round = 0; round < 4; ++round) {
      Asset pair = built(old_scan, config);
      const Asset before = built(old_scan, config);
      const Bounds3d box = random_box(0.6f);
      const UpdateReport report =
          update_pair(device, pair, {.box = box, .added = &new_scan, .is_replacement = true});
      expect_whole(pair);
      EXPECT_GT(report.removed_area, 0);
      const Scan exact =
          join(clipped(old_scan, box, BoxSide::kOutside), clipped(new_scan, box, BoxSide::kInside));
      for (const Level& level : pair.rbvh()->levels) {
        const float error = level.error * pair.rbvh()->source.bounds.diagonal();
        const Level& fresh = *before.rbvh()->find_level(level.name);
        const Along was = cast_along_normals(before, level.name, old_scan, nullptr, 0, 0.03f);
        const Along now =
            cast_along_normals(pair, level.name, exact, &box, 4.0 * static_cast<double>(error), 0.03f);
        EXPECT_LE(now.misses, was.misses) << level.name;
        EXPECT_LE(now.farthest, 2 * was.farthest + 6 * error) << level.name;
        EXPECT_LE(level.reached, 2 * fresh.reached + level.error) << level.name;
      }
      expect_unchanged_beside(before, pair,
                              {box.lo - Vec3d{0.03, 0.03, 0.03}, box.hi + Vec3d{0.03, 0.03, 0.03}});
    }
  }
}

TEST_F(UpdateTest, TheSameContentLeavesNoSeam) {
  const Scan scan = sphere(48);
  for (const BuildConfig& config : {coarse({2e-4f, 2e-3f}), coarse({1e-3f}, Hybrid::kOff)}) {
    Asset pair = built(scan, config);
    const Asset before = built(scan, config);
    for (int round = 0; round < 5; ++round) {
      const Bounds3d box = random_box(0.6f);
      update_pair(device, pair, {.box = box, .added = &scan, .is_replacement = true});
      for (const Level& level : pair.rbvh()->levels) {
        const float error = level.error * pair.rbvh()->source.bounds.diagonal();
        const Along was = cast_along_normals(before, level.name, scan, nullptr, 0, 0.2f),
                    now = cast_along_normals(pair, level.name, scan, nullptr, 0, 0.2f);
        EXPECT_LE(now.misses, was.misses) << level.name << " of " << now.rays;
        EXPECT_LE(now.farthest, 2 * was.farthest + 6 * error) << level.name;
      }
    }
    expect_whole(pair);
  }
}

TEST_F(UpdateTest, AHundredInARowAreAsOneBuild) {
  const Scan scan = sphere(48);
  const BuildConfig config = coarse({2e-4f, 6e-4f});
  const Asset fresh = built(scan, config);
  Asset pair = built(scan, config);
  std::size_t half_way = 0;
  const auto primitives = [&] {
    std::size_t count = 0;
    for (const Level& level : pair.rbvh()->levels) count += primitive_count(level);
    return count;
  };
  for (int round = 0; round < 100; ++round) {
    update_pair(device, pair, {.box = random_box(0.5f), .added = &scan, .is_replacement = true});
    if (round == 49) half_way = primitives();
  }
  expect_whole(pair);
  EXPECT_LT(static_cast<double>(primitives()), 2 * static_cast<double>(half_way));
  const Asset exact = make_asset(Scan(scan));
  const MeasureConfig measure{.views = {.views = 4, .resolution = 256}, .distances = true, .memory = {}};
  const std::vector<std::string> names = level_names(pair);
  const auto now = measure_levels(device, pair, exact, names, measure),
             was = measure_levels(device, fresh, exact, names, measure);
  for (std::size_t i = 0; i < now.size(); ++i) {
    const HitFidelity &a = now[i].views.all, &b = was[i].views.all;
    EXPECT_LE(a.holes + a.leaks, b.holes + b.leaks + a.pixels / 20000) << names[i];
    EXPECT_LE(a.walls, b.walls) << names[i];
    const double error = static_cast<double>(pair.rbvh()->levels[i].error);
    EXPECT_LE(a.dt.median, b.dt.median + 0.25 * error) << names[i];
    EXPECT_LE(now[i].to_level.rms, error * now[i].diagonal) << names[i];
    EXPECT_LE(now[i].to_scan.rms, error * now[i].diagonal) << names[i];
  }
  const RbvhSource &a = pair.rbvh()->source, &b = fresh.rbvh()->source;
  EXPECT_NEAR(a.area, b.area, 0.05 * b.area);
  EXPECT_NEAR(static_cast<double>(length(a.bounds.lo - b.bounds.lo) + length(a.bounds.hi - b.bounds.hi)), 0,
              0.02);
  EXPECT_GT(4 * a.triangles, b.triangles) << "an estimate by area, and triangles at the poles are small";
  EXPECT_LT(a.triangles, 4 * b.triangles);
}

TEST_F(UpdateTest, RemovedAndAddedBackItIsTheSameSurface) {
  const Scan scan = sphere(40);
  const BuildConfig config = coarse({5e-4f});
  Asset pair = built(scan, config);
  const Bounds3d box{{0.2, -0.5, -0.5}, {1.5, 0.5, 0.5}};
  const UpdateReport removed = update_pair(device, pair, {.box = box});
  EXPECT_NEAR(removed.added_area, 0, 1e-9);
  const Scan left = clipped(scan, box, BoxSide::kOutside), part = clipped(scan, box, BoxSide::kInside);
  const auto distance = [&](const Scan& from) {
    return sampled_distance(surface_of(from), ClosestPoint(surface_of(pair.rbvh()->levels[0])), 20000);
  };
  const double error = 5e-4 * static_cast<double>(pair.rbvh()->source.bounds.diagonal());
  EXPECT_LE(distance(left).rms, error);
  EXPECT_GT(distance(part).max, 0.2);
  // Nothing is left in the box but for what rounding leaves at its faces.
  const auto margin = Vec3d{error, error, error};
  for (const Vec3f& p : pair.rbvh()->levels[0].primitives.positions)
    EXPECT_FALSE(contains({box.lo + margin, box.hi - margin}, Vec3d(p)));
  Scan compact = part;
  const UpdateReport added = update_pair(device, pair, {.added = &compact});
  EXPECT_NEAR(removed.removed_area, added.added_area * (1 - removed.removed_area), 0.01);
  EXPECT_LE(distance(scan).rms, error);
  EXPECT_EQ(objects_of(pair.rbvh()->levels[0]), (std::vector<std::uint32_t>{0, 1}));
  expect_whole(pair);
}

Scan two_spheres() {
  Scan scan = sphere(24), other = sphere(24);
  for (Vec3f& p : other.positions) p.x += 3;
  Scan both = join(scan, other);
  both.object_ids.assign(both.triangles.size(), 0);
  std::fill(both.object_ids.begin() + static_cast<std::ptrdiff_t>(scan.triangles.size()),
            both.object_ids.end(), 4);
  return both;
}

TEST_F(UpdateTest, ObjectsGoAndAreReplaced) {
  const BuildConfig config = coarse({5e-4f, 4e-3f});
  Asset pair = built(two_spheres(), config);
  update_pair(device, pair, {.object = 0});
  expect_whole(pair);
  EXPECT_EQ(objects_of(pair.rbvh()->levels[0]), std::vector<std::uint32_t>{4});
  EXPECT_NEAR(pair.bounds.lo.x, 2, 0.1) << "bounds follow what is left";
  const double two = static_cast<double>(built(two_spheres(), config).rbvh()->source.area);
  EXPECT_NEAR(pair.rbvh()->source.area, 0.5 * two, 0.02 * two);

  pair = built(two_spheres(), config);
  Scan third = sphere(24, 0.1f);
  for (Vec3f& p : third.positions) p.x += 6;
  update_pair(device, pair, {.object = 0, .added = &third, .is_replacement = true});
  expect_whole(pair);
  EXPECT_EQ(objects_of(pair.rbvh()->levels[1]), (std::vector<std::uint32_t>{0, 4}));
  EXPECT_NEAR(pair.bounds.lo.x, 2, 0.15);
  EXPECT_NEAR(pair.bounds.hi.x, 7, 0.15);
  const double error =
      static_cast<double>(pair.rbvh()->levels[0].error * pair.rbvh()->source.bounds.diagonal());
  EXPECT_NEAR(error, 5e-4 * static_cast<double>(bounds(two_spheres()).diagonal()), 1e-6)
      << "errors stay what they were in scan units";
}

TEST_F(UpdateTest, TexelsOfPrimitivesAreAsWideAsBefore) {
  Asset pair = built(sphere(32), coarse({5e-4f, 4e-3f}));
  std::uniform_real_distribution<double> size(0.15, 0.3);
  for (const Vec3d& center :
       {Vec3d{1, 0, 0}, Vec3d{-1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, -1, 0}, Vec3d{0.7, 0, 0.7}}) {
    std::vector<float> before, after;
    for (const Level& level : pair.rbvh()->levels)
      before.push_back(primitive_texel(pair.rbvh()->source.area, level.rho));
    const double area = pair.rbvh()->source.area;
    update_pair(device, pair, {.box = grown({center, center}, size(random))});
    for (const Level& level : pair.rbvh()->levels)
      after.push_back(primitive_texel(pair.rbvh()->source.area, level.rho));
    EXPECT_EQ(before, after);
    EXPECT_LT(pair.rbvh()->source.area, area);
  }
}

Scan cloud_of(const Scan& mesh) {
  Scan cloud;
  cloud.positions = mesh.positions;
  complete_cloud(cloud, {});
  return cloud;
}

TEST_F(UpdateTest, CloudsOfTilesAndOfDiscs) {
  const Scan old_cloud = cloud_of(sphere(70)), new_cloud = cloud_of(sphere(70, 0.05f, 1.2f));
  for (const Hybrid hybrid : {Hybrid::kOff, Hybrid::kAuto, Hybrid::kAlways}) {
    const BuildConfig config{.levels = standard_levels({"Q0", "Q3"}), .hybrid = hybrid};
    Asset pair = built(old_cloud, config);
    const Asset before = built(old_cloud, config);
    const Bounds3d box{{0.3, -0.6, -0.5}, {1.5, 0.5, 0.6}};
    update_pair(device, pair, {.box = box, .added = &new_cloud, .is_replacement = true});
    expect_whole(pair);
    for (const Level& level : pair.rbvh()->levels) {
      const ClosestPoint surface(surface_of(level));
      for (const Scan* cloud : {&old_cloud, &new_cloud})
        for (const Vec3f& p : cloud->positions) {
          const double beside = 0.1 + 2.5 * texel_side(level);
          const Vec3d q(p), inner{beside, beside, beside};
          const bool is_old = cloud == &old_cloud, is_in = contains({box.lo + inner, box.hi - inner}, q),
                     is_out = !contains({box.lo - inner, box.hi + inner}, q);
          if (std::abs(p.z) > 0.9f || (!is_in && !is_out)) continue;  // poles have many points
          const float distance = surface.distance(p);
          if (is_old == is_out)
            EXPECT_LT(distance, 0.08f) << level.name;
          else
            EXPECT_GT(distance, 0.03f) << level.name;
        }
    }
    expect_unchanged_beside(before, pair, {box.lo - Vec3d{0.2, 0.2, 0.2}, box.hi + Vec3d{0.2, 0.2, 0.2}});
  }
}

TEST_F(UpdateTest, LayersAndColorsAreKept) {
  Scan scan = sphere(40);
  ScalarProperty height{"level", {}};
  for (const Vec3f& p : scan.positions) {
    scan.colors.push_back({200, static_cast<std::uint8_t>(100 + 50 * p.z), 50});
    height.values.push_back(p.z);
  }
  scan.properties = {height};
  for (const Hybrid hybrid : {Hybrid::kAuto, Hybrid::kOff})
    for (const double scale : {1.0, 2.0}) {
      Asset pair = built(scan, coarse({1e-3f}, hybrid));
      add_property_layers(pair.rbvh()->levels, scan, {"level"}, scale);
      const Bounds3d box{{0.1, -0.5, -0.4}, {1.5, 0.4, 0.5}};
      Scan plain = scan;
      plain.properties.clear();
      plain.colors.clear();
      Asset without = built(scan, coarse({1e-3f}, hybrid));
      add_property_layers(without.rbvh()->levels, scan, {"level"}, scale);
      EXPECT_TRUE(
          update_pair(device, pair, {.box = box, .added = &scan, .is_replacement = true}).notes.empty());
      const UpdateReport report =
          update_pair(device, without, {.box = box, .added = &plain, .is_replacement = true});
      EXPECT_EQ(report.notes.size(), 2u) << "no colours, no values";
      for (const Asset* asset : {&pair, &without}) {
        expect_whole(*asset);
        const Level& level = asset->rbvh()->levels[0];
        const Layer* layer = find_layer(level, "level");
        ASSERT_NE(layer, nullptr);
        ASSERT_NE(find_layer(level, "color"), nullptr);
        const PointIndex index = make_point_index(device, level);
        const auto values = sample_layer(index, level, *layer, scan.positions, 0.05f);
        const auto colors = sample_layer(index, level, *find_layer(level, "color"), scan.positions, 0.05f);
        std::size_t none = 0, inside = 0;
        for (std::size_t i = 0; i < values.size(); ++i) {
          const Vec3d margin{0.1, 0.1, 0.1}, p(scan.positions[i]);
          const bool is_in = contains({box.lo + margin, box.hi - margin}, p),
                     is_out = !contains({box.lo - margin, box.hi + margin}, p);
          inside += is_in;
          none += is_in && std::isnan(values[i]);
          if (is_out || (is_in && asset == &pair)) {
            EXPECT_NEAR(values[i], p.z, 0.06) << i;
            EXPECT_NEAR(colors[3 * i], 200.0 / 255, 0.03) << i;
            EXPECT_NEAR(colors[3 * i + 1], (100 + 50 * p.z) / 255, 0.04) << i;
          } else if (is_in) {
            EXPECT_NEAR(colors[3 * i + 2], 1, 0.01) << i;
          }
        }
        EXPECT_EQ(none, asset == &pair ? 0 : inside);
      }
    }
}

TEST_F(UpdateTest, WhatIsWrittenIsWhatIsRead) {
  const std::string path = (std::filesystem::path(testing::TempDir()) / "updated.rbvh").string();
  for (const Hybrid hybrid : {Hybrid::kAuto, Hybrid::kOff}) {
    const Scan scan = sphere(40);
    Asset pair = built(scan, coarse({5e-4f, 4e-3f}, hybrid));
    update_pair(device, pair, {.box = random_box(0.5f), .added = &scan, .is_replacement = true});
    write_rbvh(path, *pair.rbvh(), true);
    const Rbvh read = read_rbvh(path);
    EXPECT_EQ(read.source.area, pair.rbvh()->source.area);
    for (std::size_t i = 0; i < read.levels.size(); ++i) {
      const Level &a = read.levels[i], &b = pair.rbvh()->levels[i];
      ASSERT_EQ(a.leaves.size(), b.leaves.size());
      for (std::size_t k = 0; k < a.leaves.size(); ++k)
        EXPECT_EQ(std::memcmp(&a.leaves[k], &b.leaves[k], sizeof(RbvhLeaf)), 0) << k;
      ASSERT_EQ(a.nodes.size(), b.nodes.size());
      for (std::size_t k = 0; k < a.nodes.size(); ++k)
        EXPECT_EQ(std::memcmp(&a.nodes[k], &b.nodes[k], sizeof(RbvhNode)), 0) << k;
      EXPECT_EQ(a.primitives.positions, b.primitives.positions);
      EXPECT_EQ(a.primitives.triangles, b.primitives.triangles);
      for (std::size_t k = 0; k < a.layers.size(); ++k) EXPECT_EQ(a.layers[k].texels, b.layers[k].texels);
    }
  }
}

TEST_F(UpdateTest, WhatCannotBeIsRefusedAndNothingChanges) {
  Asset pair = built(two_spheres(), coarse({5e-4f, 4e-3f}));
  const Scan scan = sphere(20), cloud = cloud_of(sphere(20));
  const auto kind = [&](const PairChange& change) {
    try {
      update_pair(device, pair, change);
    } catch (const Error& error) {
      return std::string(error.kind() == ErrorKind::kUsage ? "usage: " : "input: ") + error.what();
    }
    return std::string("none");
  };
  const std::size_t leaves = pair.rbvh()->levels[0].leaves.size();
  const Bounds3d beside{{50, 50, 50}, {60, 60, 60}}, hollow{{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}},
      all{{-9, -9, -9}, {9, 9, 9}}, left{{-2, -2, -2}, {1.5, 2, 2}}, right{{2.5, -0.5, -0.5}, {5, 0.5, 0.5}};
  EXPECT_TRUE(kind({}).starts_with("usage: nothing is to be changed"));
  EXPECT_TRUE(kind({.box = beside}).starts_with("usage: the box lies beside"));
  EXPECT_TRUE(kind({.box = hollow}).starts_with("usage: nothing of the pair"));
  EXPECT_TRUE(kind({.box = all}).starts_with("usage: nothing would be left"));
  EXPECT_TRUE(kind({.object = 3}).starts_with("usage: the pair has no object 3"));
  EXPECT_TRUE(kind({.box = left, .object = 0}).starts_with("usage: a box goes or an object"));
  EXPECT_TRUE(kind({.box = left, .added = &cloud, .is_replacement = true}).starts_with("input: "));
  EXPECT_TRUE(kind({.box = right, .added = &scan, .is_replacement = true})
                  .starts_with("input: what is to be added has nothing"));
  EXPECT_EQ(pair.rbvh()->levels[0].leaves.size(), leaves);
  Asset other = make_asset(Scan(scan));
  EXPECT_THROW(update_pair(device, other, {.box = left}), Error);
}

}  // namespace
}  // namespace rbvh
