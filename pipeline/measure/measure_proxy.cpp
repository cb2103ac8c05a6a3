#include "pipeline/measure/measure_proxy.h"

#include "pipeline/measure/surface_distance.h"
#include "pipeline/proxy/proxy_surface.h"

namespace rbvh {
namespace {

constexpr std::size_t kDistanceSamples = 200'000;

}  // namespace

ProxyMeasure measure_proxy(const Proxy& proxy, const Scan& scan) {
  const TriangleSoup from = surface_of(scan), to = surface_of(proxy);
  return {sampled_distance(to, ClosestPoint(from), kDistanceSamples),
          sampled_distance(from, ClosestPoint(to), kDistanceSamples), bounds(scan).diagonal()};
}

}  // namespace rbvh
