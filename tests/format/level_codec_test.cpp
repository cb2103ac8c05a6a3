// A level's streams: what is encoded comes back, and no bytes do more than be refused.
#include "io/level_codec.h"

#include <gtest/gtest.h>
#include <zstd.h>

#include <atomic>
#include <cstdlib>
#include <limits>
#include <new>

#include "pipeline/base/error.h"
#include "pipeline/rbvh/check_rbvh.h"
#include "tests/format/pair_test.h"
#include "tests/format/random_level.h"
#include "tests/property.h"

namespace {
std::atomic<std::size_t> largest_allocation{0};
}

// Every vector's memory comes from here: hostile counts must not be believed.
[[gnu::noinline]] void* operator new(std::size_t size) {
  std::size_t largest = largest_allocation;
  while (size > largest && !largest_allocation.compare_exchange_weak(largest, size)) {
  }
  if (void* memory = std::malloc(std::max<std::size_t>(size, 1))) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace rbvh {
namespace {

constexpr double kArea = 3.5;
/// What a decoder may reserve beside 1100 times the streams' bytes.
constexpr std::size_t kOwnMemory = 1 << 20;

/// Meshes and clouds, on grids and not, of tiles, of primitives and of both.
std::vector<RandomLevelConfig> all_configs() {
  std::vector<RandomLevelConfig> configs;
  for (const bool discs : {false, true})
    for (const bool colors : {false, true})
      for (const bool on_grid : {false, true})
        for (const bool on_lattice : {false, true})
          for (const double share : {0.0, 0.5, 1.0})
            configs.push_back({.primitive_share = share,
                               .discs = discs,
                               .colors = colors,
                               .on_grid = on_grid,
                               .on_lattice = on_lattice});
  return configs;
}

/// The level without what the streams hold.
Level without_streams(const Level& level) {
  Level rest = level;
  rest.nodes.clear();
  rest.leaves.clear();
  rest.primitive_leaves.clear();
  rest.primitives = {};
  return rest;
}

Level decode(const Level& rest, const LevelStreams& streams, const LevelCounts& counts) {
  Level level = without_streams(rest);
  decode_streams(streams, counts, kArea, "a.rbvh", level);
  return level;
}

Rbvh pair_of(const Level& level) {
  Rbvh rbvh;
  rbvh.source = {"random.ply", 1, 2, 3, kArea, {}, "metre", level.bounds};
  rbvh.build_options = "{}";
  rbvh.levels = {level};
  return rbvh;
}

/// Whether the streams are refused, by the decoder or by find_fault(). What is accepted must be a level that
/// can be written again.
bool is_refused(const Level& rest, const LevelStreams& streams, const LevelCounts& counts) {
  largest_allocation = 0;
  try {
    const Rbvh rbvh = pair_of(decode(rest, streams, counts));
    EXPECT_LE(largest_allocation, 1100 * stream_bytes(streams) + kOwnMemory);
    if (find_fault(rbvh)) return true;
    encode_streams(rbvh.levels[0], "a.rbvh");
    return false;
  } catch (const Error& error) {
    EXPECT_LE(largest_allocation, 1100 * stream_bytes(streams) + kOwnMemory);
    EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    return true;
  }
}

std::array<std::vector<std::uint8_t> LevelStreams::*, 7> all_streams() {
  return {&LevelStreams::tree,   &LevelStreams::leaves, &LevelStreams::positions, &LevelStreams::normals,
          &LevelStreams::colors, &LevelStreams::radii,  &LevelStreams::triangles};
}

std::vector<std::uint8_t> unpack(const std::vector<std::uint8_t>& packed) {
  std::vector<std::uint8_t> raw(ZSTD_getFrameContentSize(packed.data(), packed.size()));
  EXPECT_EQ(ZSTD_decompress(raw.data(), raw.size(), packed.data(), packed.size()), raw.size());
  return raw;
}

std::vector<std::uint8_t> pack(const std::vector<std::uint8_t>& raw) {
  std::vector<std::uint8_t> packed(ZSTD_compressBound(raw.size()));
  packed.resize(ZSTD_compress(packed.data(), packed.size(), raw.data(), raw.size(), 1));
  return packed;
}

TEST(LevelCodec, LevelsComeBackAsTheyAre) {
  Random random(property_seed());
  for (const RandomLevelConfig& config : all_configs())
    for (const std::uint32_t leaves : {1u, 2u, 20u, 300u}) {
      RandomLevelConfig sized = config;
      sized.leaves = leaves;
      const Level level = random_level(random, sized, kArea);
      ASSERT_EQ(find_fault(pair_of(level)), std::nullopt);
      const Level again = decode(level, encode_streams(level, "a"), level_counts(level));
      expect_equal(level, again);
      if (testing::Test::HasFailure()) FAIL() << leaves << " leaves, share " << config.primitive_share;
    }
}

// Levels of other makers: vertices in any order, triangles that begin with any corner.
TEST(LevelCodec, VerticesAndTrianglesMayHaveAnyOrder) {
  Random random(property_seed());
  for (int trial = 0; trial < 50; ++trial) {
    Level level = random_level(random, {.colors = true}, kArea);
    Scan& mesh = level.primitives;
    std::vector<std::uint32_t> numbers(mesh.positions.size());
    for (std::uint32_t i = 0; i < numbers.size(); ++i) numbers[i] = i;
    std::shuffle(numbers.begin(), numbers.end(), random);
    const Scan before = mesh;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      mesh.positions[numbers[i]] = before.positions[i];
      mesh.normals[numbers[i]] = before.normals[i];
      mesh.colors[numbers[i]] = before.colors[i];
    }
    for (Triangle& t : mesh.triangles) {
      for (std::uint32_t& corner : t) corner = numbers[corner];
      std::rotate(t.begin(), t.begin() + random() % 3, t.end());
      if (random() % 8 == 0) t[random() % 3] = t[random() % 3];
    }
    const Scan again = decode(level, encode_streams(level, "a"), level_counts(level)).primitives;
    EXPECT_EQ(again.positions, mesh.positions);
    EXPECT_EQ(again.colors, mesh.colors);
    ASSERT_EQ(again.triangles.size(), mesh.triangles.size());
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      Triangle t = again.triangles[i];
      for (int turn = 0; turn < 2 && t != mesh.triangles[i]; ++turn)
        std::rotate(t.begin(), t.begin() + 1, t.end());
      EXPECT_EQ(t, mesh.triangles[i]);
    }
  }
}

TEST(LevelCodec, CutStreamsAreRefused) {
  Random random(property_seed());
  for (const RandomLevelConfig& config : all_configs()) {
    const Level level = random_level(random, config, kArea);
    const LevelStreams whole = encode_streams(level, "a");
    for (const auto stream : all_streams()) {
      LevelStreams cut = whole;
      while (!(cut.*stream).empty()) {
        (cut.*stream).pop_back();
        // Without colours or radii it is another level, which may be right.
        const bool refused = is_refused(level, cut, level_counts(level));
        ASSERT_TRUE(refused || (cut.*stream).empty()) << (cut.*stream).size();
      }
    }
  }
}

// Damage to the compressed bytes, and to what a true zstd frame holds.
TEST(LevelCodec, DamagedStreamsDoNoHarm) {
  Random random(property_seed());
  const auto damage = [&](std::vector<std::uint8_t>& bytes) {
    bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1 << random() % 8);
    if (random() % 2 == 0) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random() % 3 - 1);
  };
  int refused = 0, accepted = 0;
  for (const RandomLevelConfig& config : all_configs()) {
    const Level level = random_level(random, config, kArea);
    const LevelStreams whole = encode_streams(level, "a");
    for (const auto stream : all_streams()) {
      if ((whole.*stream).empty()) continue;
      const std::vector<std::uint8_t> raw = unpack(whole.*stream);
      for (int trial = 0; trial < 200; ++trial) {
        LevelStreams damaged = whole;
        if (trial % 2 == 0) {
          damage(damaged.*stream);
        } else {
          std::vector<std::uint8_t> other = raw;
          damage(other);
          damaged.*stream = pack(other);
        }
        ++(is_refused(level, damaged, level_counts(level)) ? refused : accepted);
      }
    }
  }
  EXPECT_GT(refused, 1000);
  EXPECT_GT(accepted, 1000);  // other positions, other colours: find_fault() has seen them
}

TEST(LevelCodec, RandomBytesDoNoHarm) {
  Random random(property_seed());
  for (const RandomLevelConfig& config : all_configs()) {
    const Level level = random_level(random, config, kArea);
    const LevelStreams whole = encode_streams(level, "a");
    for (const auto stream : all_streams()) {
      if ((whole.*stream).empty()) continue;
      const std::size_t size = unpack(whole.*stream).size();
      for (int trial = 0; trial < 30; ++trial) {
        std::vector<std::uint8_t> bytes(trial % 3 == 0 ? random() % 2000 : size);
        // The first byte of meshoptimizer's streams says what they are.
        for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
        if (!bytes.empty() && trial % 2 == 0) bytes[0] = unpack(whole.*stream)[0];
        LevelStreams other = whole;
        other.*stream = pack(bytes);
        is_refused(level, other, level_counts(level));
      }
    }
  }
}

TEST(LevelCodec, WrongCountsDoNoHarm) {
  Random random(property_seed());
  constexpr std::uint32_t kMost = std::numeric_limits<std::uint32_t>::max();
  for (const RandomLevelConfig& config : all_configs()) {
    const Level level = random_level(random, config, kArea);
    const LevelStreams streams = encode_streams(level, "a");
    for (const auto count : {&LevelCounts::leaves, &LevelCounts::primitive_leaves, &LevelCounts::vertices,
                             &LevelCounts::triangles})
      for (const std::uint32_t wrong :
           {0u, 1u, level_counts(level).*count - 1, level_counts(level).*count + 1, 1000u, 1u << 24,
            kMost / 3 + 1, kMost}) {
        LevelCounts counts = level_counts(level);
        if (counts.*count == wrong) continue;
        counts.*count = wrong;
        EXPECT_TRUE(is_refused(level, streams, counts)) << wrong;
      }
  }
}

TEST(LevelCodec, BombsAreRefused) {
  Random random(property_seed());
  const std::vector<std::uint8_t> bomb = pack(std::vector<std::uint8_t>(64 << 20));  // some kilobytes
  for (const RandomLevelConfig& config : all_configs()) {
    const Level level = random_level(random, config, kArea);
    for (const auto stream : all_streams()) {
      LevelStreams streams = encode_streams(level, "a");
      if ((streams.*stream).empty()) continue;
      streams.*stream = bomb;
      EXPECT_TRUE(is_refused(level, streams, level_counts(level)));
    }
  }
}

TEST(LevelCodec, GridsThatAreNoNumbersAreRefused) {
  Random random(property_seed());
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const RandomLevelConfig& config : all_configs()) {
    const Level level = random_level(random, config, kArea);
    const LevelStreams streams = encode_streams(level, "a");
    for (const float wrong : {nan, inf, -inf, -1.0f, 1e38f})
      for (int field = 0; field < 6; ++field) {
        Level other = level;
        float* const fields[] = {&other.grid.frame_step, &other.grid.box_step,    &other.lattice.step,
                                 &other.grid.origin.y,   &other.lattice.origin.y, &other.rho};
        *fields[field] = wrong;
        const bool refused = is_refused(other, streams, level_counts(level));
        EXPECT_TRUE(refused || std::isfinite(wrong)) << field << " " << wrong;
      }
  }
}

// What compresses better than a reader believes is padded.
TEST(LevelCodec, EqualLeavesComeBack) {
  Random random(property_seed());
  Level level = random_level(random, {.leaves = 1 << 17, .primitive_share = 0}, kArea);
  for (RbvhLeaf& leaf : level.leaves) leaf = level.leaves[0];
  for (RbvhNode& node : level.nodes) {
    std::copy_n(level.nodes[0].lo, 3, node.lo);
    std::copy_n(level.nodes[0].hi, 3, node.hi);
  }
  // A full tree, whose bits are alike as well.
  const std::uint32_t leaves = 1 << 17;
  level.nodes.assign(1, level.nodes[0]);
  std::uint32_t next_leaf = 0;
  std::vector<std::array<std::uint32_t, 2>> stack = {{0, leaves}};
  while (!stack.empty()) {
    const auto [node, below] = stack.back();
    stack.pop_back();
    if (below == 1) {
      level.nodes[node].first = next_leaf++;
      level.nodes[node].count = 1;
      continue;
    }
    const auto left = static_cast<std::uint32_t>(level.nodes.size());
    level.nodes.resize(left + 2, level.nodes[0]);
    level.nodes[node].first = left;
    level.nodes[node].count = 0;
    stack.push_back({left + 1, below / 2});
    stack.push_back({left, below / 2});
  }
  const LevelStreams streams = encode_streams(level, "a");
  EXPECT_LT(unpack(streams.leaves).size(), 1100 * stream_bytes(streams));
  expect_equal(level, decode(level, streams, level_counts(level)));
}

}  // namespace
}  // namespace rbvh
