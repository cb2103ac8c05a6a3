// Small pairs for tests, and how to damage them so that only the intended fault is there.
#pragma once

#include <xxhash.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

using Bytes = std::vector<char>;

inline Bytes read_bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

inline void write_bytes(const std::string& path, const Bytes& bytes) {
  std::filesystem::remove(path);  // ext4 syncs a file that is cut and written anew, which takes milliseconds
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

template <class T>
T get(const Bytes& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

template <class T>
void put(Bytes& bytes, std::size_t at, const T& value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

/// Where the seal (length, hash, major, minor) of an .rbvh lies, found as docs/file_format.md says; nothing
/// where the bytes hold none.
inline std::optional<std::size_t> find_seal(const Bytes& bytes) {
  if (bytes.size() < 40) return {};
  const std::uint64_t table = get<std::uint32_t>(bytes, 0);
  if (table + 4 > bytes.size()) return {};
  const std::int64_t vtable = static_cast<std::int64_t>(table) - get<std::int32_t>(bytes, table);
  if (vtable < 0 || static_cast<std::uint64_t>(vtable) + 6 > bytes.size()) return {};
  const std::uint64_t seal = table + get<std::uint16_t>(bytes, static_cast<std::size_t>(vtable) + 4);
  if (seal + 24 > bytes.size()) return {};
  return seal;
}

/// Gives damaged bytes the length and the hash that they carry then rightly.
inline void reseal(Bytes& bytes) {
  const std::optional<std::size_t> seal = find_seal(bytes);
  if (!seal) return;
  put<std::uint64_t>(bytes, *seal, bytes.size());
  put<std::uint64_t>(bytes, *seal + 8, 0);
  put<std::uint64_t>(bytes, *seal + 8, XXH3_64bits(bytes.data(), bytes.size()));
}

/// Two levels, a layer of each kind, three tiles that fill 6 x 5 texels; `seed` makes another one.
inline Rbvh make_small_rbvh(std::uint32_t seed = 0) {
  Rbvh rbvh;
  rbvh.source = {"small.ply", 0x1234567890abcdefu + seed, 12, 10, 3.5, {1e6, 2e6, 0},
                 "metre",     {{0, 0, 0}, {4, 1, 1}}};
  rbvh.build_options = R"({"refinement":"projected-area"})";
  for (const char* name : {"Q0", "Q1"}) {
    Level level;
    level.name = name;
    level.rho = 100;
    level.alpha = 0.85f;
    level.phi_degrees = 45;
    level.bounds = {{0, 0, 0}, {4, 1, 1}};
    level.nodes = {{{0, 0, 0}, 1, {4, 1, 1}, 0},
                   {{0, 0, 0}, 0, {1, 1, 1}, 1},
                   {{1, 0, 0}, 3, {4, 1, 1}, 0},
                   {{1, 0, 0}, 1, {2, 1, 1}, 1},
                   {{2, 0, 0}, 2, {4, 1, 1}, 1}};
    level.leaves = {{{2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1000, 1}, 0, 0, 3, 3, 4, 0},
                    {{2, 0, 0, -2, 0, 2, 0, 0, 0, 0, 1000, 1}, 3, 0, 3, 3, 3, 0},
                    {{2, 0, 0, -4, 0, 2, 0, 0, 0, 0, 1000, 1}, 0, 3, 6, 2, 3, 1}};
    level.atlas_width = 6;
    level.atlas_height = 5;
    level.layers = {{"height", 1, {}}, {"normal", 1, {}}, {"color", 1, {}}};
    for (Layer& layer : level.layers)
      for (std::uint32_t i = 0; i < 30; ++i)
        layer.texels.push_back(static_cast<std::uint16_t>((i + seed) * 2477u +
                                                          static_cast<std::uint32_t>(layer.name[0]) * 7919u));
    level.texels_used = 29;
    rbvh.levels.push_back(std::move(level));
  }
  rbvh.levels[1].layers.pop_back();
  rbvh.levels[1].fidelity = {0.25f, 1e-6f, 1e-4f, 0, 2, 3, true};
  return rbvh;
}

}  // namespace rbvh
