// A picture of what a tracer sees: rays over the pixels, their hits, their surface, shaded.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "rbvh/camera.h"
#include "rbvh/image.h"
#include "rbvh/tracer.h"

#pragma GCC visibility push(default)
namespace rbvh {

enum class Aov {
  kShaded,
  kNormal,
  kDepth,
  kPosition,
  kLeaf,
  kSteps,
  // Of light: made by rbvh/light.h, not by render().
  kOcclusion,
  kAlbedo,
  kShadow,
  kDirect,
  kIndirect
};

/// Whether it is one of light's.
inline bool is_of_light(Aov aov) { return aov >= Aov::kOcclusion; }

/// "shaded", "normal" ..., or nothing for any other word.
std::optional<Aov> find_aov(std::string_view name);

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

}  // namespace rbvh
#pragma GCC visibility pop
