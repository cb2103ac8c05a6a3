// What the tests of pairs on disk share: a folder of their own, damaged files, comparing pairs.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>

#include "io/rbvh_file.h"
#include "pipeline/base/error.h"
#include "tests/format/pair_bytes.h"

namespace rbvh {
namespace fs = std::filesystem;

class RbvhFileTest : public testing::Test {
 protected:
  RbvhFileTest() {
    std::string pattern = (fs::temp_directory_path() / "rbvh_pair_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  ~RbvhFileTest() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  // The one line that reading `name` fails with.
  std::string refusal(const std::string& name) const {
    try {
      read_rbvh(path(name));
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    return {};
  }
  // How a.rbvh is refused after `damage` to its bytes and a new seal.
  std::string refusal_after(const std::function<void(Bytes&)>& damage) const {
    write_rbvh(path("a.rbvh"), make_small_rbvh(), true);
    return refusal_of_damaged(path("a.rbvh"), damage);
  }
  // The same of any pair, which is left as it is.
  std::string refusal_of_damaged(const std::string& pair, const std::function<void(Bytes&)>& damage) const {
    Bytes bytes = read_bytes(pair);
    const Bytes atlas = read_bytes(atlas_path(pair));
    damage(bytes);
    reseal(bytes);
    write_bytes(path("damaged.rbvh"), bytes);
    write_bytes(path("damaged.atlas.tif"), atlas);
    return refusal("damaged.rbvh");
  }

  fs::path folder_;
};

inline void expect_contains(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << '"' << text << "\" lacks \"" << part << '"';
}

inline void expect_equal(const Layer& a, const Layer& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.channels, b.channels);
  EXPECT_EQ(a.texels, b.texels);
  EXPECT_EQ(a.lo, b.lo);
  EXPECT_EQ(a.hi, b.hi);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  ASSERT_EQ(a.tiles.size(), b.tiles.size());
  for (std::size_t k = 0; k < a.tiles.size(); ++k)
    EXPECT_EQ(std::memcmp(&a.tiles[k], &b.tiles[k], sizeof(LayerTile)), 0);
}

inline void expect_equal(const Level& a, const Level& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.rho, b.rho);
  EXPECT_EQ(a.alpha, b.alpha);
  EXPECT_EQ(a.phi_degrees, b.phi_degrees);
  EXPECT_EQ(a.error, b.error);
  EXPECT_EQ(a.bounds.lo, b.bounds.lo);
  EXPECT_EQ(a.bounds.hi, b.bounds.hi);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  EXPECT_EQ(std::memcmp(a.nodes.data(), b.nodes.data(), a.nodes.size() * sizeof(RbvhNode)), 0);
  ASSERT_EQ(a.leaves.size(), b.leaves.size());
  EXPECT_EQ(std::memcmp(a.leaves.data(), b.leaves.data(), a.leaves.size() * sizeof(RbvhLeaf)), 0);
  ASSERT_EQ(a.primitive_leaves.size(), b.primitive_leaves.size());
  for (std::size_t k = 0; k < a.primitive_leaves.size(); ++k) {
    EXPECT_EQ(a.primitive_leaves[k].leaf, b.primitive_leaves[k].leaf);
    EXPECT_EQ(a.primitive_leaves[k].first, b.primitive_leaves[k].first);
  }
  EXPECT_EQ(a.primitives.positions, b.primitives.positions);
  EXPECT_EQ(a.primitives.normals, b.primitives.normals);
  EXPECT_EQ(a.primitives.colors, b.primitives.colors);
  EXPECT_EQ(a.primitives.radii, b.primitives.radii);
  EXPECT_EQ(a.primitives.triangles, b.primitives.triangles);
  EXPECT_EQ(a.lattice.origin, b.lattice.origin);
  EXPECT_EQ(a.lattice.step, b.lattice.step);
  EXPECT_EQ(a.grid.origin, b.grid.origin);
  EXPECT_EQ(a.grid.frame_step, b.grid.frame_step);
  EXPECT_EQ(a.grid.box_step, b.grid.box_step);
  EXPECT_EQ(a.atlas_width, b.atlas_width);
  EXPECT_EQ(a.atlas_height, b.atlas_height);
  ASSERT_EQ(a.layers.size(), b.layers.size());
  for (std::size_t k = 0; k < a.layers.size(); ++k) expect_equal(a.layers[k], b.layers[k]);
  EXPECT_EQ(a.texels_used, b.texels_used);
  EXPECT_EQ(a.derived_from, b.derived_from);
  EXPECT_EQ(a.fidelity.measured, b.fidelity.measured);
  if (a.fidelity.measured) {
    EXPECT_EQ(a.fidelity.mask_mismatch_percent, b.fidelity.mask_mismatch_percent);
    EXPECT_EQ(a.fidelity.p99_dt, b.fidelity.p99_dt);
    EXPECT_EQ(a.fidelity.walls, b.fidelity.walls);
    EXPECT_EQ(std::memcmp(&a.fidelity.more, &b.fidelity.more, sizeof a.fidelity.more), 0);
  }
}

inline void expect_equal(const Rbvh& a, const Rbvh& b) {
  EXPECT_EQ(a.source.name, b.source.name);
  EXPECT_EQ(a.source.hash, b.source.hash);
  EXPECT_EQ(a.source.vertices, b.source.vertices);
  EXPECT_EQ(a.source.triangles, b.source.triangles);
  EXPECT_EQ(a.source.area, b.source.area);
  EXPECT_EQ(a.source.shift, b.source.shift);
  EXPECT_EQ(a.source.units, b.source.units);
  EXPECT_EQ(a.source.bounds.hi, b.source.bounds.hi);
  EXPECT_EQ(a.build_options, b.build_options);
  ASSERT_EQ(a.levels.size(), b.levels.size());
  for (std::size_t i = 0; i < a.levels.size(); ++i) expect_equal(a.levels[i], b.levels[i]);
}

/// The small pair with all that version 1.2 brought.
inline Rbvh make_layered_rbvh() {
  Rbvh rbvh = make_small_rbvh();
  Level& level = rbvh.levels[0];
  level.derived_from = "Q9";
  level.fidelity = rbvh.levels[1].fidelity;
  level.fidelity.more = {50,    1e-3f, 1,     5,     0.01f, std::numeric_limits<float>::infinity(),
                         0.9f,  0.02f, 30,    0.95f, 1e-5f, 1e-3f,
                         2e-5f, 2e-3f, 1e-4f, 8,     1024};
  Layer layer{"wear", 2, {}, -1.5f, 4, 10, 7, {{0, 0, 5, 5}, {5, 0, 5, 5}, {0, 5, 10, 2}}};
  for (std::uint32_t i = 0; i < 140; ++i) layer.texels.push_back(static_cast<std::uint16_t>(i * 331));
  level.layers.push_back(layer);
  return rbvh;
}

}  // namespace rbvh
