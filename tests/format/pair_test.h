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
    Bytes bytes = read_bytes(path("a.rbvh"));
    damage(bytes);
    reseal(bytes);
    write_bytes(path("a.rbvh"), bytes);
    return refusal("a.rbvh");
  }
  // The same, with a changed struct in the place of the first one that equals `from`.
  template <class T>
  std::string refusal_with(const T& from, const std::function<void(T&)>& change) const {
    return refusal_after([&](Bytes& bytes) {
      for (std::size_t at = 0; at + sizeof(T) <= bytes.size(); at += 4)
        if (std::memcmp(bytes.data() + at, &from, sizeof(T)) == 0) {
          T to = from;
          change(to);
          return put(bytes, at, to);
        }
      ADD_FAILURE() << "no such struct";
    });
  }

  fs::path folder_;
};

inline void expect_contains(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << '"' << text << "\" lacks \"" << part << '"';
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
  for (std::size_t i = 0; i < a.levels.size(); ++i) {
    const Level &p = a.levels[i], &q = b.levels[i];
    EXPECT_EQ(p.name, q.name);
    EXPECT_EQ(p.rho, q.rho);
    EXPECT_EQ(p.alpha, q.alpha);
    EXPECT_EQ(p.phi_degrees, q.phi_degrees);
    EXPECT_EQ(p.bounds.lo, q.bounds.lo);
    EXPECT_EQ(p.texels_used, q.texels_used);
    ASSERT_EQ(p.nodes.size(), q.nodes.size());
    EXPECT_EQ(std::memcmp(p.nodes.data(), q.nodes.data(), p.nodes.size() * sizeof(RbvhNode)), 0);
    ASSERT_EQ(p.leaves.size(), q.leaves.size());
    EXPECT_EQ(std::memcmp(p.leaves.data(), q.leaves.data(), p.leaves.size() * sizeof(RbvhLeaf)), 0);
    ASSERT_EQ(p.primitive_leaves.size(), q.primitive_leaves.size());
    for (std::size_t k = 0; k < p.primitive_leaves.size(); ++k) {
      EXPECT_EQ(p.primitive_leaves[k].leaf, q.primitive_leaves[k].leaf);
      EXPECT_EQ(p.primitive_leaves[k].first, q.primitive_leaves[k].first);
    }
    EXPECT_EQ(p.primitives.positions, q.primitives.positions);
    EXPECT_EQ(p.primitives.normals, q.primitives.normals);
    EXPECT_EQ(p.primitives.colors, q.primitives.colors);
    EXPECT_EQ(p.primitives.radii, q.primitives.radii);
    EXPECT_EQ(p.primitives.triangles, q.primitives.triangles);
    ASSERT_EQ(p.layers.size(), q.layers.size());
    for (std::size_t k = 0; k < p.layers.size(); ++k) {
      EXPECT_EQ(p.layers[k].name, q.layers[k].name);
      EXPECT_EQ(p.layers[k].channels, q.layers[k].channels);
      EXPECT_EQ(p.layers[k].texels, q.layers[k].texels);
    }
    EXPECT_EQ(p.fidelity.measured, q.fidelity.measured);
    if (p.fidelity.measured) {
      EXPECT_EQ(p.fidelity.mask_mismatch_percent, q.fidelity.mask_mismatch_percent);
      EXPECT_EQ(p.fidelity.p99_dt, q.fidelity.p99_dt);
      EXPECT_EQ(p.fidelity.walls, q.fidelity.walls);
    }
  }
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
