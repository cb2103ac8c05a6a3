// One vertex for all corners at exactly the same position: what formats without shared vertices need.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "pipeline/base/error.h"
#include "rbvh/geometry.h"

namespace rbvh {

/// Vertices numbered in order of first use. A hash table with linear probing, at most half full.
class Welder {
 public:
  std::vector<Vec3d> positions;

  std::uint32_t add(Vec3d p) {
    if (2 * (positions.size() + 1) > slots_.size()) grow();
    std::uint32_t& slot = find(p);
    if (slot == kEmpty) {
      RBVH_CHECK(positions.size() < kEmpty);
      slot = static_cast<std::uint32_t>(positions.size());
      positions.push_back(p);
    }
    return slot;
  }

 private:
  static constexpr std::uint32_t kEmpty = UINT32_MAX;

  /// Bits, so that NaN equals itself; adding zero makes -0 and +0 one.
  static std::uint64_t bits(double x) { return std::bit_cast<std::uint64_t>(x + 0.0); }
  static bool same(Vec3d a, Vec3d b) {
    return bits(a.x) == bits(b.x) && bits(a.y) == bits(b.y) && bits(a.z) == bits(b.z);
  }
  std::uint32_t& find(Vec3d p) {
    std::uint64_t hash = bits(p.x) * 0x9e3779b97f4a7c15u;
    hash = (hash ^ (hash >> 29) ^ bits(p.y)) * 0xbf58476d1ce4e5b9u;
    hash = (hash ^ (hash >> 32) ^ bits(p.z)) * 0x94d049bb133111ebu;
    std::size_t at = (hash ^ (hash >> 31)) & (slots_.size() - 1);
    while (slots_[at] != kEmpty && !same(positions[slots_[at]], p)) at = (at + 1) & (slots_.size() - 1);
    return slots_[at];
  }
  void grow() {
    slots_.assign(slots_.empty() ? 64 : 2 * slots_.size(), kEmpty);
    for (std::size_t i = 0; i < positions.size(); ++i) find(positions[i]) = static_cast<std::uint32_t>(i);
  }
  std::vector<std::uint32_t> slots_;
};

}  // namespace rbvh
