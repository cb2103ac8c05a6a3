// How far a proxy is from its scan.
#pragma once

#include "pipeline/proxy/proxy.h"
#include "rbvh/measure.h"
#include "rbvh/scan.h"

namespace rbvh {

/// A proxy's distance to the scan, both ways.
struct ProxyMeasure {
  DistanceStatistics to_scan, to_proxy;  ///< scan units
  double diagonal = 0;                   ///< of the scan
};
ProxyMeasure measure_proxy(const Proxy& proxy, const Scan& scan);

}  // namespace rbvh
