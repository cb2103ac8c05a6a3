#include "pipeline/render/edges.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel_for.h"
#include "pipeline/trace/camera_rays.h"

namespace rbvh {
namespace {

constexpr float kWidth = 0.8f;  // pixels to each side
constexpr float kDark = 0.75f;
constexpr std::size_t kRows = 8;

bool same_primitive(const Hit& a, const Hit& b) {
  return a.leaf == b.leaf && a.flags >> RBVH_HIT_PRIMITIVE_SHIFT == b.flags >> RBVH_HIT_PRIMITIVE_SHIFT;
}

struct Grid {
  const std::vector<Hit>& hits;
  std::ptrdiff_t width, height;

  const Hit* at(std::ptrdiff_t x, std::ptrdiff_t y) const {
    return x < 0 || y < 0 || x >= width || y >= height ? nullptr
                                                       : &hits[static_cast<std::size_t>(y * width + x)];
  }

  /// How much of an edge the pixel shows, 0 to 1.
  float edge(std::ptrdiff_t x, std::ptrdiff_t y) const {
    const Hit& own = *at(x, y);
    if (own.leaf == RBVH_NO_LEAF) return 0;
    // What u and v change by from a pixel to the next; the primitive may end on either side.
    float slope[2][2] = {};
    bool known = true, ends = false;
    for (int axis = 0; axis < 2; ++axis) {
      bool found = false;
      for (const int step : {1, -1}) {
        const Hit* other = at(x + (axis == 0 ? step : 0), y + (axis == 1 ? step : 0));
        if (other == nullptr || other->leaf == RBVH_NO_LEAF) continue;
        if (!same_primitive(own, *other)) {
          ends = true;
          continue;
        }
        slope[axis][0] = other->u - own.u;
        slope[axis][1] = other->v - own.v;
        found = true;
      }
      known = known && found;
    }
    if ((own.flags & RBVH_HIT_ON_PRIMITIVE) == 0 || !known) return ends ? 1.f : 0.f;
    float nearest = kWidth + 1;
    const float du = std::hypot(slope[0][0], slope[1][0]), dv = std::hypot(slope[0][1], slope[1][1]),
                dw = std::hypot(slope[0][0] + slope[0][1], slope[1][0] + slope[1][1]);
    for (const auto& [value, change] : {std::pair{own.u, du}, {own.v, dv}, {1 - own.u - own.v, dw}})
      if (change > 0) nearest = std::min(nearest, std::abs(value) / change);
    return std::clamp(kWidth + 0.5f - nearest, 0.f, 1.f);
  }
};

}  // namespace

void draw_edges(const Tracer& tracer, const Camera& camera, Image& picture) {
  const std::vector<Hit> hits = intersect(tracer, camera_rays(camera, picture.width, picture.height));
  const Grid grid{hits, picture.width, picture.height};
  const std::size_t channels = picture.channels.size();
  parallel_for(picture.height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (std::size_t x = 0; x < picture.width; ++x) {
        const float light =
            1 - kDark * grid.edge(static_cast<std::ptrdiff_t>(x), static_cast<std::ptrdiff_t>(y));
        float* pixel = picture.at(x, y);
        for (std::size_t c = 0; c < std::min<std::size_t>(3, channels); ++c) pixel[c] *= light;
      }
  });
}

}  // namespace rbvh
