// Pairs whose numbers lie: each is refused by name, and none does harm.
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

// The first fault of the small pair after that.
std::string fault_after(const std::function<void(Level&)>& damage) {
  Rbvh rbvh = make_small_rbvh();
  damage(rbvh.levels[0]);
  return find_fault(rbvh).value_or("");
}

TEST_F(RbvhFileTest, HostileNodes) {
  const auto root = [&](const std::function<void(RbvhNode&)>& change) {
    return fault_after([&](Level& level) { change(level.nodes[0]); });
  };
  const auto leaf = [&](const std::function<void(RbvhNode&)>& change) {
    return fault_after([&](Level& level) { change(level.nodes[1]); });
  };
  EXPECT_EQ(root([](RbvhNode&) {}), "");
  expect_contains(root([](RbvhNode& n) { n.first = 0; }), "come after");
  expect_contains(root([](RbvhNode& n) { n.first = 4; }), "of 5 nodes");
  expect_contains(root([](RbvhNode& n) { n.first = 0xffffffffu; }), "of 5 nodes");
  expect_contains(root([](RbvhNode& n) { n.first = 2; }), "no parent");
  expect_contains(root([](RbvhNode& n) { n.first = 3; }), "no parent");
  expect_contains(root([](RbvhNode& n) { n.count = 2; }), "2 leaves");
  expect_contains(leaf([](RbvhNode& n) { n.first = 3; }), "leaf 3 of 3");
  expect_contains(leaf([](RbvhNode& n) { n.first = 2; }), "two nodes");
  expect_contains(leaf([](RbvhNode& n) { n.count = 0, n.first = 2; }), "two parents");
  expect_contains(leaf([](RbvhNode& n) { n.lo[1] = 2; }), "inverted");
  expect_contains(leaf([](RbvhNode& n) { n.hi[2] = std::numeric_limits<float>::infinity(); }), "not finite");
  expect_contains(leaf([](RbvhNode& n) { n.lo[0] = std::nanf(""); }), "not finite");
}

TEST_F(RbvhFileTest, HostileTiles) {
  const auto leaf = [&](const std::function<void(RbvhLeaf&)>& change) {
    return fault_after([&](Level& level) { change(level.leaves[0]); });
  };
  EXPECT_EQ(leaf([](RbvhLeaf&) {}), "");
  expect_contains(leaf([](RbvhLeaf& l) { l.width = 1; }), "at least 2");
  expect_contains(leaf([](RbvhLeaf& l) { l.height = 0; }), "at least 2");
  expect_contains(leaf([](RbvhLeaf& l) { l.x = 4; }), "beyond the atlas");
  expect_contains(leaf([](RbvhLeaf& l) { l.y = 65535; }), "beyond the atlas");
  expect_contains(leaf([](RbvhLeaf& l) { l.width = 6; }), "overlap");
  expect_contains(leaf([](RbvhLeaf& l) { l.to_tile[3] = std::nanf(""); }), "not finite");
  expect_contains(leaf([](RbvhLeaf& l) { l.to_tile[0] = 0; }), "inverted");
  expect_contains(leaf([](RbvhLeaf& l) { l.to_tile[4] = 2, l.to_tile[5] = 0; }), "inverted");
  expect_contains(leaf([](RbvhLeaf& l) { l.to_tile[10] = 1e30f; }), "inverted");
}

TEST_F(RbvhFileTest, HostileGrids) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  expect_contains(fault_after([&](Level& l) { l.grid.origin.x = nan; }), "grid");
  expect_contains(fault_after([&](Level& l) { l.lattice.origin.z = inf; }), "lattice");
  expect_contains(fault_after([&](Level& l) { l.lattice.step = -1; }), "lattice");
  expect_contains(fault_after([&](Level& l) { l.grid.frame_step = l.grid.box_step = inf; }), "grid");
  expect_contains(fault_after([&](Level& l) { l.grid.box_step = 1; }), "alone");
  expect_contains(fault_after([&](Level& l) { l.grid.frame_step = 1; }), "alone");
  expect_contains(fault_after([&](Level& l) { l.error = nan; }), "parameter");
}

TEST_F(RbvhFileTest, HostilePrimitives) {
  const auto fault = [&](const std::function<void(Level&)>& change) {
    Rbvh rbvh = make_rbvh_of_discs();
    change(rbvh.levels[0]);
    return find_fault(rbvh).value_or("");
  };
  EXPECT_EQ(fault([](Level&) {}), "");
  expect_contains(fault([](Level& l) { l.primitive_leaves[1].leaf = 3; }), "leaf 3 of 3");
  expect_contains(fault([](Level& l) { l.primitive_leaves[1].leaf = 1; }), "out of order");
  expect_contains(fault([](Level& l) { l.primitive_leaves[1].first = 1; }), "from number 1 on");
  expect_contains(fault([](Level& l) { l.leaves[2].primitives = 0; }), "has 0 primitives");
  expect_contains(fault([](Level& l) { l.leaves[2].primitives = 0xffffffffu; }), "has 4294967295 primitives");
  expect_contains(fault([](Level& l) {
                    l.primitives.positions.push_back({});
                    l.primitives.radii.push_back(1);
                    l.primitives.normals.push_back({0, 0, 1});
                  }),
                  "4 primitives, and leaves that use 3");
  expect_contains(fault([](Level& l) { l.primitive_leaves.clear(); }), "3 primitives, and leaves that use 0");
  expect_contains(fault([](Level& l) { l.primitives.positions[2].z = std::nanf(""); }), "not finite");
  expect_contains(fault([](Level& l) { l.primitives.radii[2] = -1; }), "negative");
  expect_contains(fault([](Level& l) { l.primitives.normals[2].x = 2; }), "not of length 1");
  expect_contains(fault([](Level& l) { l.primitives.normals.pop_back(); }), "other numbers");
  expect_contains(fault([](Level& l) { l.primitives.colors.pop_back(); }), "other numbers");
  expect_contains(fault([](Level& l) { l.primitives.colors.clear(); }), "without colours");
}

// Whatever the bytes, a true seal around them gets nothing in but what find_fault() accepts.
TEST_F(RbvhFileTest, DamageUnderATrueSealDoesNoHarm) {
  for (const Rbvh& rbvh : {make_small_rbvh(), make_built_rbvh(false), make_built_rbvh(true)}) {
    write_rbvh(path("a.rbvh"), rbvh, true);
    const Bytes whole = read_bytes(path("a.rbvh"));
    int refused = 0;
    for (std::size_t at = 0; at < whole.size(); ++at)
      for (const int bit : {0, 7}) {
        Bytes bytes = whole;
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << bit));
        reseal(bytes);
        PairHeader header;
        try {
          EXPECT_EQ(find_fault(decode_hierarchy(std::as_bytes(std::span(bytes)), "a", header)), std::nullopt);
        } catch (const Error& error) {
          EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
          EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
          ++refused;
        }
      }
    EXPECT_GT(refused, 500);
  }
}

TEST_F(RbvhFileTest, HostileCounts) {
  const std::array<std::uint32_t, 4> counts = {3, 0, 0, 0};  // leaves, of primitives, vertices, triangles
  for (std::size_t which = 0; which < 4; ++which)
    for (const std::uint32_t count : {0u, 1u, 4u, 1000u, 1u << 26, 0xffffffffu}) {
      if (count == counts[which]) continue;
      std::size_t found = 0;
      const std::string why = refusal_after([&](Bytes& bytes) {
        for (std::size_t at = 0; at + sizeof counts <= bytes.size(); at += 4)
          if (get<std::array<std::uint32_t, 4>>(bytes, at) == counts) {
            put(bytes, at + 4 * which, count);
            ++found;
          }
      });
      EXPECT_GE(found, 2u);
      expect_contains(why, "cannot be decoded");
    }
}

TEST_F(RbvhFileTest, WriterRefusesWhatItsReaderWould) {
  const auto refused = [&](const std::function<void(Rbvh&)>& change) -> std::string {
    Rbvh rbvh = make_small_rbvh();
    change(rbvh);
    try {
      write_rbvh(path("a.rbvh"), rbvh, true);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kFailure);
      EXPECT_EQ(files(), 0u);
      return error.what();
    }
    return {};
  };
  expect_contains(refused([](Rbvh& r) { r.levels.clear(); }), "0 levels");
  expect_contains(refused([](Rbvh& r) { r.levels[1].name = "Q0"; }), "twice");
  expect_contains(refused([](Rbvh& r) { r.levels[1].name = "../Q1"; }), "letters");
  expect_contains(refused([](Rbvh& r) { r.levels[0].layers[1].name = ""; }), "letters");
  expect_contains(refused([](Rbvh& r) { r.levels[0].layers.erase(r.levels[0].layers.begin()); }), "height");
  expect_contains(refused([](Rbvh& r) { r.levels[0].layers[0].texels.pop_back(); }), "29 values");
  expect_contains(refused([](Rbvh& r) { r.levels[0].layers[1].channels = 9; }), "9 channels");
  expect_contains(refused([](Rbvh& r) { r.levels[0].atlas_width = 1; }), "2 to 65535");
  expect_contains(refused([](Rbvh& r) { r.levels[0].texels_used = 31; }), "31 of 30");
  expect_contains(refused([](Rbvh& r) { r.levels[0].leaves.pop_back(); }), "need 3");
  expect_contains(refused([](Rbvh& r) { r.levels[0].leaves.clear(); }), "no leaf");
  expect_contains(refused([](Rbvh& r) { r.levels[0].rho = std::nanf(""); }), "parameter");
  expect_contains(refused([](Rbvh& r) { r.levels[1].fidelity.p99_dt = std::nanf(""); }), "fidelity");
  expect_contains(refused([](Rbvh& r) { r.source.area = std::nan(""); }), "source");
  expect_contains(refused([](Rbvh& r) { r.build_options = "none"; }), "JSON");
  expect_contains(refused([](Rbvh& r) { r.build_options = "[]"; }), "JSON");
  expect_contains(refused([](Rbvh& r) {
                    r.build_options = R"({"a":)" + std::string(40, '[') + std::string(40, ']') + "}";
                  }),
                  "JSON");
  EXPECT_EQ(refused([](Rbvh&) {}), "");
}

// A chain of `depth` inner nodes below the root's level.
Rbvh make_chain(std::uint32_t inner) {
  Rbvh rbvh = make_small_rbvh();
  rbvh.levels.resize(1);
  Level& level = rbvh.levels[0];
  const RbvhNode box = level.nodes[0];
  level.nodes.assign(1, box);
  level.leaves.assign(inner + 1, level.leaves[0]);
  for (std::uint32_t i = 0; i < inner; ++i) {
    level.nodes.resize(level.nodes.size() + 2, box);
    RbvhNode& parent = level.nodes[i == 0 ? 0 : 2 * i];
    parent.first = 2 * i + 1;
    parent.count = 0;
    level.nodes[2 * i + 1].first = i;
    level.nodes[2 * i + 1].count = 1;
  }
  level.nodes.back().first = inner;
  level.nodes.back().count = 1;
  level.atlas_width = 3;
  level.atlas_height = 3 * (inner + 1);
  level.layers.resize(1);
  level.layers[0].texels.assign(std::size_t{9} * (inner + 1), 7);
  for (std::uint32_t i = 0; i <= inner; ++i) level.leaves[i].y = static_cast<std::uint16_t>(3 * i);
  return rbvh;
}

TEST_F(RbvhFileTest, DepthIsBounded) {
  write_rbvh(path("a.rbvh"), make_chain(kMaxLeafHierarchyDepth), false);
  EXPECT_EQ(refusal("a.rbvh"), "");
  try {
    write_rbvh(path("b.rbvh"), make_chain(kMaxLeafHierarchyDepth + 1), false);
    ADD_FAILURE() << "written";
  } catch (const Error& error) {
    expect_contains(error.what(), "deeper than 64");
  }
}

// An atlas is bounded by its file, whatever the hierarchy claims and however true the hashes are.
TEST_F(RbvhFileTest, AtlasOfAnotherSizeIsRefused) {
  Rbvh rbvh = make_small_rbvh();
  write_rbvh(path("a.rbvh"), rbvh, true);
  // The same files, but a hierarchy that claims a larger atlas and carries this atlas's hash.
  const Bytes atlas = read_bytes(path("a.atlas.tif"));
  Bytes hierarchy;
  {
    Rbvh larger = rbvh;
    for (Level& level : larger.levels) {
      level.atlas_width = 60000;
      for (Layer& layer : level.layers) layer.texels.resize(std::size_t{60000} * level.atlas_height);
    }
    write_rbvh(path("b.rbvh"), larger, true);
    hierarchy = read_bytes(path("b.rbvh"));
  }
  const std::uint64_t length = fs::file_size(path("b.atlas.tif"));
  bool patched = false;
  for (std::size_t at = 0; at + 16 <= hierarchy.size(); at += 4)
    if (get<std::uint64_t>(hierarchy, at) == length) {
      const Bytes other = read_bytes(path("b.atlas.tif"));
      const std::uint64_t hash = XXH3_64bits(other.data(), other.size());
      for (std::size_t h = 0; h + 8 <= hierarchy.size(); h += 4)
        if (get<std::uint64_t>(hierarchy, h) == hash) {
          put<std::uint64_t>(hierarchy, at, atlas.size());
          put<std::uint64_t>(hierarchy, h, XXH3_64bits(atlas.data(), atlas.size()));
          patched = true;
        }
    }
  ASSERT_TRUE(patched);
  reseal(hierarchy);
  write_bytes(path("a.rbvh"), hierarchy);
  const std::string why = refusal("a.rbvh");
  EXPECT_TRUE(why.find("Q0.height is not the 60000 x 5") != std::string::npos ||
              why.find("too small") != std::string::npos)
      << why;
}

}  // namespace
}  // namespace rbvh
