#include "pipeline/bvh/morton_order.h"

#include <string>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/bvh/bvh.h"
#include "pipeline/device/radix_sort.h"

namespace rbvh {
namespace {

struct Float4 {
  float x, y, z, w;
};

Bounds3f bounds_of_centers(std::span<const Bounds3f> boxes, const std::vector<std::uint32_t>& usable) {
  Bounds3f bounds;
  for (const std::uint32_t i : usable) bounds.add(boxes[i].lo * 0.5f + boxes[i].hi * 0.5f);
  return bounds;
}

template <class Key>
void sort_codes(const Device& device, MortonOrder& order, const Bounds3f& centers, Buffer<Key>& codes) {
  constexpr bool kLong = sizeof(Key) == 8;
  constexpr float kCells = kLong ? 2097152.0f : 1024.0f;
  const auto scale = [](float extent) {
    const float cells = kCells / extent;
    return extent > 0 && std::isfinite(cells) ? cells : 0.0f;
  };
  const Vec3f e = centers.extent();
  codes = Buffer<Key>(device, order.count);
  device.kernel("bvh/morton_order", "morton_order_codes", kLong ? "-DKEY=ulong" : "-DKEY=uint")
      .run(order.count, element_group_size(device), order.boxes, order.indices, order.count,
           Float4{centers.lo.x, centers.lo.y, centers.lo.z, 0}, Float4{scale(e.x), scale(e.y), scale(e.z), 0},
           kCells - 1, codes);
  device.finish();
  Stopwatch watch;
  radix_sort(device, codes, order.indices, order.count, kLong ? 63 : 30);
  device.finish();
  order.sort_seconds = watch.lap();
}

}  // namespace

MortonOrder morton_order(const Device& device, std::span<const Bounds3f> boxes, MortonBits bits) {
  static_assert(sizeof(Bounds3f) == 6 * sizeof(float));
  RBVH_CHECK(boxes.size() < (1u << 31));
  const std::vector<std::uint32_t> usable = usable_boxes(boxes);
  MortonOrder order;
  order.count = static_cast<std::uint32_t>(usable.size());
  if (usable.empty()) return order;
  order.boxes =
      Buffer<float>(device, std::span(reinterpret_cast<const float*>(boxes.data()), 6 * boxes.size()));
  order.indices = Buffer<std::uint32_t>(device, usable);
  const Bounds3f centers = bounds_of_centers(boxes, usable);
  if (bits == MortonBits::k63) {
    sort_codes(device, order, centers, order.codes63);
  } else {
    sort_codes(device, order, centers, order.codes30);
  }
  return order;
}

}  // namespace rbvh
