#include "io/ray_file.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "io/output_file.h"
#include "pipeline/scan/precision.h"

namespace rbvh {

NpyReader open_rays(const std::string& path) {
  constexpr std::size_t kColumns[] = {6, 8};
  return NpyReader(path, kColumns);
}

double coarse_step(const NpyReader& rays, const Asset& asset, Vec3d shift) {
  if (rays.is_double() || shift == Vec3d{}) return 0;
  const double step = float_step(std::max({std::abs(shift.x), std::abs(shift.y), std::abs(shift.z)}));
  return step > 1e-5 * static_cast<double>(asset.bounds.diagonal()) ? step : 0;
}

RayTableCounts cast_ray_file(const Tracer& tracer, NpyReader& rays, Vec3d shift, RayQuery query,
                             const std::string& output, bool overwrite, const Progress& progress) {
  OutputFile file(output, overwrite);
  file.write(npy_header(rays.rows(), kHitColumns));
  const auto write = [&](std::span<const Hit> hits) {
    const std::vector<float> rows = hit_rows(hits);
    file.write(std::as_bytes(std::span(rows)));
  };
  const RayStream stream{.columns = rays.columns(),
                         .rows = rays.rows(),
                         .read = [&](std::span<float> to) { return rays.read(to, shift); },
                         .write = write,
                         .stop = [&] { rays.stop(); }};
  const RayTableCounts counts = trace_stream(tracer, stream, query, progress);
  file.commit();
  return counts;
}

}  // namespace rbvh
