#pragma once
namespace rbvh {
inline constexpr float kRadiusPerSpacing = 1.0f;
}  // namespace rbvh
