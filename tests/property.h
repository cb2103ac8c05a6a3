// What the property tests share: a seed that is new every run, printed so that a failure can be had again by
// setting RBVH_TEST_SEED.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>

namespace rbvh {

inline std::uint64_t property_seed() {
  static const std::uint64_t seed = [] {
    const char* given = std::getenv("RBVH_TEST_SEED");
    const std::uint64_t value = given != nullptr ? std::strtoull(given, nullptr, 10) : std::random_device{}();
    std::printf("RBVH_TEST_SEED=%llu\n", static_cast<unsigned long long>(value));
    std::fflush(stdout);
    return value;
  }();
  return seed;
}

}  // namespace rbvh
