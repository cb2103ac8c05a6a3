// A pair as one HTML page that ray casts it in a browser (docs/viewer.md).
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/device.h"
#include "rbvh/image.h"

#pragma GCC visibility push(default)
namespace rbvh {

struct ViewConfig {
  /// Of the page. The finest levels that fit are taken.
  std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max();
  /// Shown until scripts run, and where they cannot: a picture of the pair, with alpha.
  std::optional<Image> still{};
};

/// A still of 512 x 512 pixels, as ViewConfig wants it, from the three-quarter view.
Image draw_still(const Device& device, const Asset& pair);

struct ViewBytes {
  std::uint64_t page = 0;
  std::vector<std::string> levels;          ///< that are in it, finest first
  std::vector<std::uint64_t> level_bytes;   ///< each one's in the page
  std::vector<std::uint64_t> stored_bytes;  ///< and in the pair it was read from; 0: it was not read
};

/// Writes all levels that `pair` was loaded with. The page needs no network and no other file. Identical
/// input gives identical bytes. Throws Error(kUsage) for another asset than a pair, Error(kBudget) where no
/// level fits, Error(kFailure).
ViewBytes write_view(const std::string& path, const Asset& pair, const ViewConfig& config, bool overwrite);

}  // namespace rbvh
#pragma GCC visibility pop
