#include "rbvh/render.h"
#include "rbvh/viewer.h"

namespace rbvh {

Image draw_still(const Device& device, const Asset& pair) {
  constexpr std::uint32_t kPixels = 512;
  RenderConfig config;
  config.width = config.height = kPixels;
  config.up = static_cast<Vec3f>(pair.up_axis());
  TracerConfig finest;
  finest.level = level_names(pair).front();
  const std::unique_ptr<Tracer> tracer = make_tracer(device, pair, finest);
  return render(*tracer, place_camera({}, to_double(pair.bounds), pair.up_axis(), 1), config);
}

}  // namespace rbvh
