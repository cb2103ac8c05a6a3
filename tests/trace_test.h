// What the tests of the tracers share.
#pragma once

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/trace/tracer.h"
#include "tests/exact_scenes.h"
#include "tests/property.h"

namespace rbvh {

/// Kernels build with an empty log.
class TraceTest : public testing::Test {
 protected:
  Random random{property_seed()};

  static void SetUpTestSuite() {
    set_build_log_sink(
        [](std::string_view file, std::string_view log) { ADD_FAILURE() << file << ": " << log; });
  }
};

/// Casts by any tracer; every hit is written.
inline std::vector<Hit> cast(const Tracer& tracer, const std::vector<Ray>& rays,
                             RayQuery query = RayQuery::kNearest,
                             std::vector<std::uint32_t>* steps = nullptr) {
  const Buffer<Ray> ray_buffer(tracer.device, rays);
  Buffer<Hit> hits(tracer.device, rays.size());
  hits.fill(0xcd);
  const Buffer<std::uint32_t> step_buffer(tracer.device, rays.size());
  tracer.intersect(ray_buffer, hits, rays.size(), query, steps != nullptr ? &step_buffer : nullptr);
  if (steps != nullptr) *steps = step_buffer.read();
  return hits.read();
}

inline bool is_hit(const Hit& hit) { return hit.leaf != RBVH_NO_LEAF; }

inline Vec3f normal_of(const Hit& hit) { return {hit.normal[0], hit.normal[1], hit.normal[2]}; }

}  // namespace rbvh
