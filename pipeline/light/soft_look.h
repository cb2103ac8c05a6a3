// The picture that previews are by default: shaded as render() shades, but the key light is soft and casts
// shadows, and what is lit from all around sees less of it in hollows.
#pragma once

#include "rbvh/light.h"

namespace rbvh {

struct SoftLook {
  float offset = 0;  ///< path_offset()
  float reach = 0;   ///< what lies farther shadows nothing from the light all around, scan units
  /// Depths alone draw outlines (eye-dome lighting; Boucheny 2009): for clouds, whose normals may be guesses.
  bool outlines = false;
};

/// Rays a pixel where nobody says: 16 where these take less than about a second, else 4.
int soft_samples(std::uint32_t width, std::uint32_t height);

/// R G B A, premultiplied, linear. Each sample casts a camera's ray, and from where it hits one to the key
/// light and one to all around; what these find is filtered along surfaces. Deterministic.
Image render_soft(const Tracer& primary, const Tracer& secondary, const Camera& camera,
                  const RenderConfig& config, const SoftLook& look, RenderTimings& timings,
                  const Progress& progress = {});

}  // namespace rbvh
