// The pair on disk: what is written comes back, in the same bytes each time, and nothing damaged gets in.
#include "io/rbvh_file.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "pipeline/rbvh/leaf_hierarchy.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/leaf_rounding.h"
#include "pipeline/rbvh/texel.h"
#include "tests/format/pair_test.h"
#include "tests/format/random_level.h"

namespace rbvh {
namespace {

// An atlas that neither side of a TIFF tile divides, and layers of every channel count.
Rbvh make_large_rbvh() {
  Rbvh rbvh = make_small_rbvh();
  Level& level = rbvh.levels[0];
  level.atlas_width = 301;
  level.atlas_height = 157;
  level.layers = {{"height", 1, {}}, {"two", 2, {}}, {"three", 3, {}}, {"four", 4, {}}};
  std::uint32_t random = 1;
  for (Layer& layer : level.layers) {
    layer.texels.resize(std::size_t{301} * 157 * layer.channels);
    for (std::uint16_t& texel : layer.texels)
      texel = static_cast<std::uint16_t>((random = random * 1664525u + 1013904223u) >> 16);
  }
  return rbvh;
}

// The same of triangles that share vertices; the last vertex has a normal that theirs does not give.
Rbvh make_rbvh_of_triangles() {
  Rbvh rbvh = make_rbvh_of_discs();
  Scan& mesh = rbvh.levels[0].primitives;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 3}, {0, 1, 3}};
  mesh.radii.clear();
  mesh.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {1, 0, 0}};
  mesh.colors = {{255, 0, 0}, {0, 255, 0}, {1, 2, 3}, {4, 5, 6}};
  return rbvh;
}

TEST_F(RbvhFileTest, RoundTrip) {
  for (const Rbvh& rbvh : {make_small_rbvh(), make_large_rbvh(), make_rbvh_of_discs(),
                           make_rbvh_of_triangles(), make_built_rbvh(false), make_built_rbvh(true)}) {
    const RbvhBytes bytes = write_rbvh(path("a.rbvh"), rbvh, true);
    EXPECT_EQ(bytes.hierarchy, fs::file_size(path("a.rbvh")));
    EXPECT_EQ(bytes.atlas, fs::file_size(path("a.atlas.tif")));
    EXPECT_EQ(files(), 2u);
    PairHeader header;
    const Rbvh read = read_rbvh(path("a.rbvh"), &header);
    expect_equal(rbvh, read);
    EXPECT_EQ(header.major, kFormatMajor);
    EXPECT_EQ(header.minor, kFormatMinor);
    EXPECT_EQ(header.hierarchy_bytes, bytes.hierarchy);
    EXPECT_EQ(header.atlas_bytes, bytes.atlas);
    std::uint64_t levels = 0;
    for (std::size_t i = 0; i < read.levels.size(); ++i) {
      EXPECT_EQ(read.levels[i].stored_bytes, bytes.levels[i]);
      levels += bytes.levels[i];
    }
    EXPECT_LE(levels, bytes.hierarchy + bytes.atlas);
    EXPECT_GE(levels + 2000, bytes.hierarchy + bytes.atlas);
  }
}

// What is not asked for is not decoded: damage there is seen only by who reads it.
TEST_F(RbvhFileTest, SomeLevelsAreAsInTheWholePair) {
  for (const Rbvh& rbvh : {make_small_rbvh(), make_rbvh_of_triangles(), make_built_rbvh(false)}) {
    write_rbvh(path("a.rbvh"), rbvh, true);
    std::vector<std::string> names;
    for (const Level& level : rbvh.levels) names.push_back(level.name);
    for (const Level& level : rbvh.levels) {
      PairHeader header;
      const Rbvh read = read_rbvh(path("a.rbvh"), &header, {}, [&](const std::vector<std::string>& there) {
        EXPECT_EQ(there, names);
        return std::vector{level.name};
      });
      EXPECT_EQ(header.levels, names.size());
      Rbvh wanted = rbvh;
      wanted.levels = {level};
      expect_equal(wanted, read);
    }
  }
  Rbvh damaged = make_small_rbvh();
  write_rbvh(path("a.rbvh"), damaged, true);
  Bytes bytes = read_bytes(path("a.rbvh"));
  const std::array<std::uint32_t, 4> counts = {3, 0, 0, 0};  // of each level, Q1's first in the file
  std::size_t at = 0;
  while (get<std::array<std::uint32_t, 4>>(bytes, at) != counts) at += 4;
  put(bytes, at, std::uint32_t{1000});
  reseal(bytes);
  write_bytes(path("a.rbvh"), bytes);
  EXPECT_NE(refusal("a.rbvh"), "");
  int refused = 0;
  for (const std::string name : {"Q0", "Q1"}) {
    try {
      read_rbvh(path("a.rbvh"), nullptr, {}, [&](const auto&) { return std::vector{name}; });
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_EQ(refused, 1);
}

TEST_F(RbvhFileTest, IdenticalBytes) {
  const Rbvh rbvh = make_large_rbvh();
  set_thread_count(1);
  write_rbvh(path("a.rbvh"), rbvh, false);
  set_thread_count(4);
  fs::create_directory(path("elsewhere"));
  setenv("SOURCE_DATE_EPOCH", "12345", 1);
  sleep(1);  // a time stamp would differ
  write_rbvh(path("elsewhere/b.rbvh"), rbvh, false);
  set_thread_count(0);
  EXPECT_EQ(read_bytes(path("a.rbvh")), read_bytes(path("elsewhere/b.rbvh")));
  EXPECT_EQ(read_bytes(path("a.atlas.tif")), read_bytes(path("elsewhere/b.atlas.tif")));
}

TEST_F(RbvhFileTest, NothingLeaksIntoTheAtlas) {
  write_rbvh(path("a.rbvh"), make_small_rbvh(), false);
  const Bytes bytes = read_bytes(path("a.atlas.tif"));
  const std::string text(bytes.begin(), bytes.end());
  for (const std::string& leak :
       {std::string("OpenImageIO"), folder_.filename().string(), std::string("tmp.")})
    EXPECT_EQ(text.find(leak), std::string::npos) << leak;
  expect_contains(text, "Q1.normal");
}

TEST_F(RbvhFileTest, EveryTruncationIsRefused) {
  write_rbvh(path("a.rbvh"), make_small_rbvh(), false);
  for (const char* name : {"a.rbvh", "a.atlas.tif"}) {
    const Bytes whole = read_bytes(path(name));
    for (std::size_t size = 0; size < whole.size(); ++size) {
      write_bytes(path(name), Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)));
      ASSERT_NE(refusal("a.rbvh"), "") << name << " cut to " << size;
    }
    write_bytes(path(name), whole);
  }
  EXPECT_EQ(refusal("a.rbvh"), "");
}

TEST_F(RbvhFileTest, EveryFlippedByteIsRefused) {
  write_rbvh(path("a.rbvh"), make_small_rbvh(), false);
  for (const char* name : {"a.rbvh", "a.atlas.tif"}) {
    const Bytes whole = read_bytes(path(name));
    for (std::size_t at = 0; at < whole.size(); ++at) {
      Bytes bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << at % 8));
      write_bytes(path(name), bytes);
      ASSERT_NE(refusal("a.rbvh"), "") << name << " at " << at;
    }
    write_bytes(path(name), whole);
  }
  EXPECT_EQ(refusal("a.rbvh"), "");
}

TEST_F(RbvhFileTest, SaysWhatIsWrongWithTheFiles) {
  expect_contains(refusal("missing.rbvh"), "missing.rbvh");
  write_rbvh(path("a.rbvh"), make_small_rbvh(), false);
  Bytes bytes = read_bytes(path("a.rbvh")), atlas = read_bytes(path("a.atlas.tif"));

  bytes.pop_back();
  write_bytes(path("a.rbvh"), bytes);
  expect_contains(refusal("a.rbvh"), "is cut");
  bytes.resize(bytes.size() + 3);
  write_bytes(path("a.rbvh"), bytes);
  expect_contains(refusal("a.rbvh"), "2 bytes too many");
  write_bytes(path("a.rbvh"), Bytes(100, 'x'));
  expect_contains(refusal("a.rbvh"), "is no .rbvh file");

  write_rbvh(path("a.rbvh"), make_small_rbvh(), true);
  atlas[atlas.size() / 2] ^= 1;
  write_bytes(path("a.atlas.tif"), atlas);
  expect_contains(refusal("a.rbvh"), "damaged");
  fs::remove(path("a.atlas.tif"));
  expect_contains(refusal("a.rbvh"), "without its atlas");
}

TEST_F(RbvhFileTest, AtlasOfAnotherPairIsRefused) {
  write_rbvh(path("a.rbvh"), make_small_rbvh(0), false);
  write_rbvh(path("b.rbvh"), make_small_rbvh(1), false);
  fs::rename(path("b.atlas.tif"), path("a.atlas.tif"));
  expect_contains(refusal("a.rbvh"), "belongs to another pair");
}

TEST_F(RbvhFileTest, Versions) {
  const auto with_version = [&](std::uint16_t major, std::uint16_t minor) {
    return refusal_after([&](Bytes& bytes) {
      put(bytes, find_seal(bytes).value() + 16, major);
      put(bytes, find_seal(bytes).value() + 18, minor);
    });
  };
  expect_contains(with_version(kFormatMajor + 1, 0), "newer than the 2.x and older that this rbvh reads");
  EXPECT_EQ(with_version(kFormatMajor, 0), "");      // the oldest minor
  EXPECT_EQ(with_version(kFormatMajor, 65535), "");  // newer minors only add
  EXPECT_NE(with_version(0, 9), "");
}

// Pairs written by earlier builds stay readable.
std::string kept_pair(const std::string& name) { return std::string(RBVH_DATA) + "/pairs/" + name + ".rbvh"; }

TEST_F(RbvhFileTest, FirstVersionStillLoads) {
  expect_equal(make_small_rbvh(), read_rbvh(kept_pair("format_1_0")));
}

// A sheet of tiles, below leaves of loose triangles, coloured; "wear" is the points' z.
TEST_F(RbvhFileTest, Version12StillLoads) {
  PairHeader header;
  const Rbvh rbvh = read_rbvh(kept_pair("format_1_2"), &header);
  EXPECT_EQ(header.major, 1);
  EXPECT_EQ(header.minor, 2);
  ASSERT_EQ(rbvh.levels.size(), 1u);
  const Level& level = rbvh.levels[0];
  EXPECT_EQ(level.leaves.size(), 30u);
  EXPECT_EQ(level.primitive_leaves.size(), 16u);
  const Layer &heights = level.layers[0], &wear = *find_layer(level, "wear");
  std::uint64_t used = 0;
  std::size_t alike = 0;
  const std::vector<std::uint32_t> firsts = first_primitives(level);
  const Scan& mesh = level.primitives;
  for (std::size_t i = 0; i < level.leaves.size(); ++i) {
    const RbvhLeaf& leaf = level.leaves[i];
    for (std::size_t y = leaf.y; firsts[i] == RBVH_NO_LEAF && y < std::size_t{leaf.y} + leaf.height; ++y)
      for (std::size_t x = leaf.x; x < std::size_t{leaf.x} + leaf.width; ++x)
        used += heights.texels[y * level.atlas_width + x] != 0;
    if (firsts[i] == RBVH_NO_LEAF) continue;
    for (std::uint32_t k = firsts[i]; k < firsts[i] + leaf.primitives; ++k)
      for (const std::uint32_t vertex : mesh.triangles[k]) {
        // The sheet was z = 0.1 sin 3x cos 2y, of blue 90; the others lie above it, of blue 40. Normals and
        // colours are those of the nearest texel, which may be another's.
        const Vec3f p = mesh.positions[vertex];
        const bool is_sheet = std::abs(p.z - 0.1f * std::sin(3 * p.x) * std::cos(2 * p.y)) < 1e-5f;
        alike += std::abs(mesh.colors[vertex][2] - (is_sheet ? 90 : 40)) < 5;
        EXPECT_NEAR(length(mesh.normals[vertex]), 1, 1e-5f);
      }
  }
  EXPECT_GT(alike, mesh.positions.size() * 3 / 4);
  EXPECT_EQ(mesh.triangles.size(), 50u);
  EXPECT_GE(level.texels_used, used);
  ASSERT_EQ(wear.tiles.size(), 30u);
  EXPECT_EQ(wear.width, level.atlas_width);
  EXPECT_GT(std::count_if(wear.texels.begin(), wear.texels.end(), [](auto code) { return code != 0; }), 100);
}

TEST_F(RbvhFileTest, OldPairsAreWrittenAsNewOnes) {
  for (const char* name : {"format_1_0", "format_1_2", "format_1_2_cloud"}) {
    const Rbvh rbvh = read_rbvh(kept_pair(name));
    write_rbvh(path("a.rbvh"), rbvh, true);
    PairHeader header;
    const Rbvh again = read_rbvh(path("a.rbvh"), &header);
    EXPECT_EQ(header.major, kFormatMajor);
    expect_equal(rbvh, again);
    write_rbvh(path("b.rbvh"), again, true);
    EXPECT_EQ(read_bytes(path("a.rbvh")), read_bytes(path("b.rbvh"))) << name;
  }
}

// Changes the first struct in an old pair that equals `from`.
template <class T>
std::function<void(Bytes&)> with_struct(const T& from, const std::function<void(T&)>& change) {
  return [=](Bytes& bytes) {
    for (std::size_t at = 0; at + sizeof(T) <= bytes.size(); at += 4)
      if (std::memcmp(bytes.data() + at, &from, sizeof(T)) == 0) {
        T to = from;
        change(to);
        return put(bytes, at, to);
      }
    ADD_FAILURE() << "no such struct";
  };
}

TEST_F(RbvhFileTest, HostileOldPairs) {
  const std::string pair = kept_pair("format_1_2");
  const Level level = read_rbvh(pair).levels[0];
  const RbvhPrimitiveLeaf first = level.primitive_leaves[0], second = level.primitive_leaves[1];
  const auto leaf = [&](const std::function<void(RbvhLeaf&)>& change) {
    return refusal_of_damaged(pair, with_struct<RbvhLeaf>(level.leaves[first.leaf], change));
  };
  EXPECT_EQ(leaf([](RbvhLeaf&) {}), "");
  // Its texels give the primitives their normals.
  expect_contains(leaf([](RbvhLeaf& l) { l.x = 65000; }), "beyond the atlas");
  expect_contains(leaf([](RbvhLeaf& l) { l.y = 65000; }), "beyond the atlas");
  expect_contains(leaf([](RbvhLeaf& l) { l.width = 65535; }), "beyond the atlas");
  expect_contains(leaf([](RbvhLeaf& l) { l.height = 0; }), "too small");
  EXPECT_EQ(leaf([](RbvhLeaf& l) { l.to_tile[3] = 3e38f; }), "");  // far from all texels
  EXPECT_EQ(leaf([](RbvhLeaf& l) {
              for (int i = 0; i < 3; ++i) l.to_tile[i] *= 1e15f;
            }),
            "");
  const std::array<RbvhPrimitiveLeaf, 2> two = {first, second};
  const auto leaves = [&](const std::function<void(std::array<RbvhPrimitiveLeaf, 2>&)>& change) {
    return refusal_of_damaged(pair, with_struct<std::array<RbvhPrimitiveLeaf, 2>>(two, change));
  };
  expect_contains(leaves([](auto& l) { l[0].leaf = 30; }), "not there");
  expect_contains(leaves([](auto& l) { l[1].leaf = 0xffffffffu; }), "not there");
  expect_contains(leaves([](auto& l) { l[1].leaf = l[0].leaf; }), "out of order");
  expect_contains(leaves([](auto& l) { l[1].first = 0xffffffffu; }), "from number 4294967295 on");
  const RbvhPrimitive shape = primitive_shape(level.primitives, 0);
  expect_contains(refusal_of_damaged(pair, with_struct<RbvhPrimitive>(
                                               shape, [](RbvhPrimitive& p) { p.shape[4] = std::nanf(""); })),
                  "not finite");
}

TEST(AtlasPath, LiesBesideByStem) {
  EXPECT_EQ(atlas_path("x/a.b.rbvh"), "x/a.b.atlas.tif");
  EXPECT_EQ(atlas_path("a"), "a.atlas.tif");
}

TEST_F(RbvhFileTest, LayersAndMeasuresComeBack) {
  const Rbvh rbvh = make_layered_rbvh();
  write_rbvh(path("a.rbvh"), rbvh, false);
  expect_equal(rbvh, read_rbvh(path("a.rbvh")));
}

TEST_F(RbvhFileTest, LayersAndMeasuresAreChecked) {
  const auto fault_after = [](const std::function<void(Level&)>& damage) {
    Rbvh rbvh = make_layered_rbvh();
    damage(rbvh.levels[0]);
    return find_fault(rbvh).value_or("") + find_texel_fault(rbvh).value_or("");
  };
  EXPECT_EQ(fault_after([](Level&) {}), "");
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  const auto layer = [&](const std::function<void(Layer&)>& damage) {
    return fault_after([&](Level& level) { damage(level.layers.back()); });
  };
  expect_contains(layer([](Layer& l) { l.lo = 5; }), "range");
  expect_contains(layer([&](Layer& l) { l.hi = nan; }), "range");
  expect_contains(layer([&](Layer& l) { l.hi = inf; }), "range");
  expect_contains(layer([](Layer& l) { l.tiles.pop_back(); }), "2 tiles for 3 leaves");
  expect_contains(layer([](Layer& l) { l.tiles[1].x = 6; }), "extends beyond");
  expect_contains(layer([](Layer& l) { l.tiles[1].height = 1; }), "too small");
  expect_contains(layer([](Layer& l) { l.tiles[1] = {0, 0, 10, 7}; }), "overlap");
  expect_contains(layer([](Layer& l) { l.width = 70000; }), "65535");
  expect_contains(layer([](Layer& l) { l.texels.pop_back(); }), "139 values");
  expect_contains(fault_after([](Level& l) { l.layers[1].tiles = l.layers.back().tiles; }), "normal");
  expect_contains(fault_after([](Level& l) { l.derived_from = "a/b"; }), "derived");
  expect_contains(fault_after([&](Level& l) { l.fidelity.more.image_rmse = nan; }), "measure");
  expect_contains(fault_after([](Level& l) { l.fidelity.more.to_scan_max = -1; }), "measure");
  expect_contains(fault_after([](Level& l) { l.fidelity.more.image_ssim = 2; }), "similarity");
}

}  // namespace
}  // namespace rbvh
