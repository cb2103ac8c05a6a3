#include "pipeline/trace/trace_fronts.h"

#include <utility>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/trace/camera_rays.h"

namespace rbvh {
namespace {

constexpr int kMostBacks = 64;
constexpr float kPast = 1e-5f;  // of t: where a ray goes on behind a back face

struct FrontTracer final : Tracer {
  std::unique_ptr<Tracer> of;

  explicit FrontTracer(std::unique_ptr<Tracer> all) : Tracer(all->device), of(std::move(all)) {}

  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery /*query*/,
                 const Buffer<std::uint32_t>* steps) const override {
    // Any hit may be a back face's: the nearest are asked for, and gone past.
    of->intersect(rays, hits, count, RayQuery::kNearest, steps);
    std::vector<Ray> asked(count);
    std::vector<Hit> found(count);
    hits.read(std::span(found));
    if (none_behind(found)) return;
    rays.read(std::span(asked));
    go_on(asked, found);
    Buffer<Hit>(hits).write(found);
  }

  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>* steps) const override {
    of->intersect(camera, hits, steps);
    const std::size_t count = std::size_t{camera.width} * camera.height;
    std::vector<Hit> found(count);
    hits.read(std::span(found));
    if (none_behind(found)) return;
    std::vector<Ray> asked(count);
    for (std::size_t i = 0; i < count; ++i)
      asked[i] = pixel_ray(camera, static_cast<std::uint32_t>(i % camera.width),
                           static_cast<std::uint32_t>(i / camera.width));
    go_on(asked, found);
    Buffer<Hit>(hits).write(found);
  }

  SurfaceSamples surface(std::span<const Hit> hits, float spread) const override {
    return of->surface(hits, spread);
  }
  std::uint64_t memory() const override { return of->memory(); }
  bool is_on_demand() const override { return of->is_on_demand(); }

 private:
  static bool is_back(const Hit& hit) {
    return hit.leaf != RBVH_NO_LEAF && (hit.flags & RBVH_HIT_BACK_FACE) != 0;
  }

  static bool none_behind(const std::vector<Hit>& hits) {
    for (const Hit& hit : hits)
      if (is_back(hit)) return false;
    return true;
  }

  void go_on(const std::vector<Ray>& asked, std::vector<Hit>& found) const {
    for (int i = 0; i < kMostBacks; ++i) {
      std::vector<Ray> rays;
      std::vector<std::size_t> of_ray;
      for (std::size_t k = 0; k < found.size(); ++k) {
        if (!is_back(found[k])) continue;
        rays.push_back(asked[k]);
        rays.back().tmin = found[k].t * (1 + kPast);
        of_ray.push_back(k);
      }
      if (rays.empty()) return;
      const std::vector<Hit> next = rbvh::intersect(*of, rays);
      for (std::size_t k = 0; k < next.size(); ++k) found[of_ray[k]] = next[k];
    }
  }
};

}  // namespace

std::unique_ptr<Tracer> make_front_tracer(std::unique_ptr<Tracer> of) {
  return std::make_unique<FrontTracer>(std::move(of));
}

}  // namespace rbvh
