// A picture of what a tracer sees: rays over the pixels, their hits, their surface, shaded.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/render/camera.h"
#include "pipeline/render/image.h"
#include "pipeline/render/shade.h"
#include "pipeline/trace/tracer.h"

namespace rbvh {

inline constexpr int kShadedSamples = 4;  ///< rays a pixel, unless more or fewer are asked for

struct RenderConfig {
  std::uint32_t width = 1024, height = 1024;
  Aov aov = Aov::kShaded;
  int samples = 0;        ///< rays a pixel of a shaded picture; 0: kShadedSamples. Other AOVs have one.
  Vec3f up{0, 1, 0};      ///< where the sky is
  bool as_shown = false;  ///< other AOVs as colours for the eye, not as numbers; see shown_image()
  /// Colours in place of the surface's own, linear light, one a hit.
  std::function<std::vector<Vec3f>(std::span<const Hit>)> colors{};
};

/// Seconds, summed over all pictures, and rays cast.
struct RenderTimings {
  double trace = 0, shade = 0;
  std::uint64_t rays = 0;
};

/// Deterministic: samples lie on Hammersley's points. Throws Error(kUsage) as shown_image() does.
Image render(const Tracer& tracer, const Camera& camera, const RenderConfig& config,
             RenderTimings* timings = nullptr);

/// Where two tracers' hits of a camera's rays differ (difference_image()). `diagonal` is of what is cast at,
/// scan units; the number of pixels with another hit is added to `differing`.
Image render_difference(const Tracer& first, const Tracer& second, const Camera& camera, std::uint32_t width,
                        std::uint32_t height, float diagonal, std::uint64_t& differing,
                        RenderTimings* timings = nullptr);

/// The values of a user's layer as colours, for RenderConfig.colors: from the layer's lo to its hi.
std::vector<Vec3f> layer_colors(const Level& level, const Layer& layer, std::span<const Hit> hits);

}  // namespace rbvh
