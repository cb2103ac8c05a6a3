// Several assets at once, each as often and wherever it is placed.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "rbvh/asset.h"

#pragma GCC visibility push(default)
namespace rbvh {

struct PlacedAsset {
  Asset asset;        ///< a scan, a pair, or a proxy; no scene of several objects
  std::string level;  ///< of a pair; empty: the finest
  /// Rows of the 3 x 4 matrix that takes the asset's space into the scene's; invertible.
  std::array<double, 12> to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

/// An asset of all of them; the level or scan of each is copied. Hit.leaf numbers the leaves of all placed
/// assets through, in their order. Throws Error(kUsage) for a level that is not there or a map that is not
/// invertible.
Asset make_scene(std::span<const PlacedAsset> placed, bool z_is_up = false);

/// Of a scene: where the leaves of each placed asset start among Hit.leaf, and their number at the end. Of
/// any other asset: only 0.
std::vector<std::uint32_t> first_leaves(const Asset& asset);

}  // namespace rbvh
#pragma GCC visibility pop
