// A pair changed in a part of it, without building the rest anew.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/device.h"
#include "rbvh/progress.h"
#include "rbvh/scan.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// What goes, and what comes. At least one of them is set.
struct PairChange {
  /// What lies within goes: triangles and tiles are cut at the box's faces, discs go by their centres. In the
  /// scan's own coordinates (stored ones + shift), scan units.
  std::optional<Bounds3d> box{};
  std::optional<std::int32_t> object{};  ///< or all of this object goes; not together with a box
  /// A mesh for a pair of a mesh; a cloud, with normals and radii, for one of a cloud. Its shift may be
  /// another than the pair's.
  const Scan* added = nullptr;
  /// `added` takes the place of what goes: of it, only what lies in the box comes, with its object's id where
  /// it has none. Otherwise all comes, as objects of their own.
  bool is_replacement = false;
};

/// What an update did.
struct UpdateReport {
  struct PerLevel {
    std::string name;
    std::uint64_t leaves = 0;   ///< that the level has now
    std::uint64_t removed = 0;  ///< that went
    std::uint64_t cut = 0;      ///< of which a part went
    std::uint64_t added = 0;
  };
  std::vector<PerLevel> levels;         ///< finest first
  double removed_area = 0;              ///< of the finest level's surface, of all of it before
  double added_area = 0;                ///< likewise
  std::vector<std::string> notes;       ///< what could not be kept or had, a sentence each
  double cut = 0, build = 0, join = 0;  ///< seconds
};

/// Changes all levels of a pair, each at its own error, resolution and layers, and with the options that the
/// pair was built with. Leaves that the change does not meet stay as they are. What comes is built as by
/// build_pair(); in a box it goes on past the faces by twice the level's error, and between the cut edges of
/// old and new triangles lie narrow ones, so that no gap opens. Levels lose their measured fidelity; errors
/// stay what they were in scan units. Copies of the asset share the content, and see the change; nothing
/// changes where an error is thrown. Throws Error(kUsage) for another asset, a box beside the pair or without
/// a part of its surface, an object that it does not have, and where nothing would be left of a level;
/// Error(kInput) for a scan of the other kind or without anything in the box, and as build_pair().
UpdateReport update_pair(const Device& device, Asset& pair, const PairChange& change,
                         const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
