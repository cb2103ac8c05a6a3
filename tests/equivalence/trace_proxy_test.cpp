#include "pipeline/proxy/trace_proxy.h"

#include <gtest/gtest.h>

#include "pipeline/exact/trace_exact.h"
#include "pipeline/proxy/tessellate.h"
#include "tests/exact_scenes.h"
#include "tests/property.h"
#include "tests/proxy_shapes.h"

namespace rbvh {
namespace {

class TraceProxy : public testing::Test {
 protected:
  Device device = Device::open();
  Random random{property_seed()};
  static void SetUpTestSuite() {
    set_build_log_sink(
        [](std::string_view file, std::string_view log) { ADD_FAILURE() << file << ": " << log; });
  }
};

template <class Tracer>
std::vector<Hit> cast(const Tracer& tracer, const std::vector<Ray>& rays, RayQuery query = RayQuery::kNearest) {
  const Buffer<Ray> ray_buffer(tracer.device, rays);
  Buffer<Hit> hits(tracer.device, rays.size());
  hits.fill(0xcd);
  trace_rays(tracer, ray_buffer, hits, rays.size(), query);
  return hits.read();
}

TEST_F(TraceProxy, FirstLight) {
  const std::uint32_t level = 4;
  const Proxy proxy = displaced(quad_sphere(3), std::span(&level, 1), [](Vec3f p) { return mushrooms(p, 0.15f); });
  const ProxyTracer tracer = make_proxy_tracer(device, proxy);
  std::vector<std::uint32_t> patches;
  const Scan twin = tessellate(proxy, 32, &patches);
  const ExactTracer exact = make_exact_tracer(device, twin);
  const std::vector<Ray> rays = random_rays(random, twin, 3000);
  const std::vector<Hit> a = cast(tracer, rays), b = cast(exact, rays);
  int same = 0, found = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    found += b[i].leaf != RBVH_NO_LEAF;
    if (a[i].t == b[i].t && (a[i].leaf == RBVH_NO_LEAF) == (b[i].leaf == RBVH_NO_LEAF) &&
        (a[i].leaf == RBVH_NO_LEAF || a[i].leaf == patches[b[i].leaf]))
      ++same;
    else if (same > static_cast<int>(i) - 10)
      std::printf("%zu: t %g leaf %d, twin t %g leaf %d\n", i, a[i].t, static_cast<int>(a[i].leaf), b[i].t,
                  b[i].leaf == RBVH_NO_LEAF ? -1 : static_cast<int>(patches[b[i].leaf]));
  }
  std::printf("%d of %zu same, %d hits\n", same, rays.size(), found);
}

}  // namespace
}  // namespace rbvh
