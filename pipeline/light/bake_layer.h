// Light kept in a level's layers, and pictures drawn with it.
#pragma once

#include <cstdint>
#include <string>

#include "pipeline/rbvh/rbvh.h"
#include "rbvh/layers.h"
#include "rbvh/light.h"

namespace rbvh {

/// Bakes the front of every texel that lies on the level's surface, by config.samples rays or paths each,
/// cast at `tracer`. Returns the number of texels. `file` is for messages.
std::uint64_t bake_layer(const Device& device, const Tracer& tracer, Level& level, const BakeLayer& bake,
                         const Environment& environment, const PathConfig& config, const std::string& file,
                         const Progress& progress = {});

/// A level and its layer of light.
struct LitLevel {
  const Level* level = nullptr;
  const Layer* light = nullptr;
};

/// Throws Error(kUsage) where the asset has no such level (nullptr) or that no such layer of a user's own.
LitLevel baked_layer(const Asset& asset, const Level* level, const std::string& name);

/// A picture of the level in its own colours, lit by the layer. R, G, B, A, premultiplied.
Image render_cached(const Tracer& tracer, const LitLevel& lit, const Camera& camera, std::uint32_t width,
                    std::uint32_t height, int samples, RenderTimings* timings = nullptr);

}  // namespace rbvh
