// Selects points by their class, as lidar's programs assign it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "rbvh/scan.h"

namespace rbvh {

/// Keeps the points of a cloud whose property `classification` is one of `classes`; returns the number of
/// removed ones. Throws Error(kUsage) where the points have no such property, Error(kInput) where none is
/// left.
std::size_t keep_classes(RawScan& cloud, std::span<const std::uint8_t> classes, const std::string& file);

}  // namespace rbvh
