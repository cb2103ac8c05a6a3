// What the property tests share: a seed, the same every run unless RBVH_TEST_SEED names another, and printed.
// tests/seeds runs them with many.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "rbvh/geometry.h"

namespace rbvh {

inline std::uint64_t property_seed() {
  static const std::uint64_t seed = [] {
    const char* given = std::getenv("RBVH_TEST_SEED");
    const std::uint64_t value = given != nullptr ? std::strtoull(given, nullptr, 10) : 1;
    std::printf("RBVH_TEST_SEED=%llu\n", static_cast<unsigned long long>(value));
    std::fflush(stdout);
    return value;
  }();
  return seed;
}

/// Boxes with corners in [-10, 10]^3 and sides up to `largest`; `flat`: all in the plane z = 1.
inline std::vector<Bounds3f> random_boxes(std::size_t count, bool flat, float largest) {
  std::mt19937_64 random(property_seed());
  std::uniform_real_distribution<float> place(-10, 10), size(0, largest);
  std::vector<Bounds3f> boxes(count);
  for (Bounds3f& box : boxes) {
    box.add(Vec3f{place(random), place(random), flat ? 1.0f : place(random)});
    box.add(box.lo + Vec3f{size(random), size(random), flat ? 0.0f : size(random)});
  }
  return boxes;
}

}  // namespace rbvh
