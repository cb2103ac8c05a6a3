#include "pipeline/rbvh/primitives.h"

#include <algorithm>
#include <numeric>

#include "pipeline/base/error.h"
#include "pipeline/device/radix_sort.h"
#include "pipeline/scan/radii.h"
#include "pipeline/scan/vertex_normals.h"
#include "rbvh/build.h"

namespace rbvh {
namespace {

/// Slopes within a patch of fewer texels are noise. Texels of Q0, so that a level does not depend on which
/// others are built.
constexpr double kPatchTexels = 2;
/// Consecutive primitives that are searched for patches.
constexpr std::uint32_t kWindow = 64;

template <class T>
std::span<const float> floats(const std::vector<T>& values) {
  return {reinterpret_cast<const float*>(values.data()), values.size() * sizeof(T) / sizeof(float)};
}

std::vector<std::uint32_t> pack_colors(const std::vector<Color8>& colors) {
  std::vector<std::uint32_t> packed(colors.size());
  for (std::size_t i = 0; i < colors.size(); ++i)
    packed[i] = colors[i][0] | static_cast<std::uint32_t>(colors[i][1]) << 8 |
                static_cast<std::uint32_t>(colors[i][2]) << 16;
  return packed;
}

}  // namespace

std::size_t job_group_size(const Device& device) { return device.info().is_cpu ? 1 : 64; }

Primitives upload_primitives(const Device& device, const Scan& scan) {
  Primitives p(device);
  p.discs = scan.is_cloud();
  const std::size_t vertices = scan.positions.size();
  const std::size_t count = p.discs ? vertices : scan.triangles.size();
  RBVH_CHECK(!p.discs || (scan.normals.size() == vertices && scan.radii.size() == vertices));
  p.count = static_cast<std::uint32_t>(count);
  const Buffer<float> positions(device, floats(scan.positions));
  p.indices =
      p.discs
          ? Buffer<std::uint32_t>(device, 1)
          : Buffer<std::uint32_t>(
                device, std::span(reinterpret_cast<const std::uint32_t*>(scan.triangles.data()), 3 * count));
  p.normals = Buffer<float>(device, floats(scan.normals.empty() ? vertex_normals(scan) : scan.normals));
  p.has_colors = !scan.colors.empty();
  p.colors = p.has_colors ? Buffer<std::uint32_t>(device, pack_colors(scan.colors))
                          : Buffer<std::uint32_t>(device, 1);

  const std::size_t group = device.info().is_cpu ? 256 : 64;
  const Bounds3f box = bounds(scan);
  const auto cells = [](float extent) { return extent > 0 ? 1024.0f / extent : 0.0f; };
  const Vec3f e = box.extent();
  Buffer<std::uint32_t> codes(device, count);
  p.order = Buffer<std::uint32_t>(device, count);
  device.kernel("build/primitives", "primitives_morton")
      .run(count, group, positions, p.indices, p.discs ? 1u : 3u, p.count,
           Float4{box.lo.x, box.lo.y, box.lo.z, 0}, Float4{cells(e.x), cells(e.y), cells(e.z), 0}, codes,
           p.order);
  radix_sort(device, codes, p.order, count, 30);

  const auto& ids = scan.object_ids;
  p.has_objects = std::any_of(ids.begin(), ids.end(), [&](std::int32_t id) { return id != ids[0]; });
  p.objects = Buffer<std::uint32_t>(device, p.has_objects ? count : 1);
  if (p.has_objects) {
    RBVH_CHECK(ids.size() == count);
    std::vector<std::uint32_t> objects = p.order.read();
    for (std::uint32_t& i : objects) i = static_cast<std::uint32_t>(ids[i]);
    p.objects.write(objects);
  }

  p.shape = Buffer<float>(device, 9 * count);
  p.box_lo = Buffer<Float4>(device, count);
  p.box_hi = Buffer<Float4>(device, count);
  p.area_normal = Buffer<Float4>(device, count);
  if (p.discs) {
    const Buffer<float> radii(device, scan.radii);
    const double spacing = spacing_per_radius(scan);
    double sum = 0;
    for (const float r : scan.radii) {
      sum += r;
      p.area += spacing * spacing * static_cast<double>(r) * static_cast<double>(r);
    }
    p.mean_radius = static_cast<float>(sum / static_cast<double>(count));
    device.kernel("build/primitives", "primitives_discs")
        .run(count, group, positions, p.normals, radii, static_cast<float>(spacing), p.order, p.count,
             p.shape, p.box_lo, p.box_hi, p.area_normal);
    p.reach = Buffer<float>(device, count);
    device.kernel("build/primitives", "primitives_reach")
        .run((count + kWindow - 1) / kWindow, job_group_size(device), p.count, kWindow, p.shape, p.reach);
    const std::vector<float> reach = p.reach.read();
    p.mean_reach = std::accumulate(reach.begin(), reach.end(), 0.0f) / static_cast<float>(count);
    p.thickness = p.mean_radius * std::max(1.0f, p.mean_reach - 1);
  } else {
    p.reach = Buffer<float>(device, 1);
    Buffer<std::uint32_t> left_over(device, vertices);
    left_over.fill(0);
    device.kernel("build/primitives", "primitives_boundary").run(count, group, p.indices, p.count, left_over);
    p.area = surface_area(scan);
    device.kernel("build/primitives", "primitives_triangles")
        .run(count, group, positions, p.indices, p.order, left_over, p.count, p.shape, p.box_lo, p.box_hi,
             p.area_normal);
  }
  device.kernel("build/primitives", "primitives_smooth_areas")
      .run((count + kWindow - 1) / kWindow, job_group_size(device), p.count, kWindow,
           static_cast<float>(kPatchTexels * p.area / standard_levels().front().rho), p.area_normal,
           p.box_lo);
  device.finish();
  return p;
}

}  // namespace rbvh
