// A proxy's displaced surface as triangles, to measure it.
#pragma once

#include "pipeline/proxy/proxy.h"
#include "pipeline/scan/closest_point.h"

namespace rbvh {

/// Every texel quad as two triangles.
TriangleSoup surface_of(const Proxy& proxy);

/// Of the displaced surface.
Bounds3f surface_bounds(const Proxy& proxy);

}  // namespace rbvh
