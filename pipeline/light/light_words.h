// Light and materials as a user says them; what shines by such words is make_environment() of rbvh/light.h.
#pragma once

#include <string>
#include <string_view>

#include "rbvh/light.h"

namespace rbvh {

/// "matte", "clay" (without colours), "glossy:0.3", "metal:0.3" (roughness, 0 to 1), "glass:1.5" (index of
/// refraction, 1.01 to 4); the number may be missing. Throws Error(kUsage).
Material parse_material(std::string_view text);

/// "45,30": azimuth and elevation. Throws Error(kUsage).
LightWords::Sun parse_sun(std::string_view text);

/// "10", "10s": seconds. Throws Error(kUsage).
double parse_seconds(std::string_view text);

/// PathConfig.max_bounces, 1 to 1000. Throws Error(kUsage).
int parse_bounces(std::string_view text);

/// PathConfig.seed. Throws Error(kUsage).
std::uint32_t parse_seed(std::string_view text);

/// The AOV of that name. Throws Error(kUsage).
Aov parse_aov(std::string_view text);

/// The name of a light, or of a file that is there. Throws Error(kUsage).
std::string parse_light(std::string_view text);

}  // namespace rbvh
