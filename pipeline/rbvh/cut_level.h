// A level whose leaves are changed: without its hierarchy, and cut at a box.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/rbvh/clip_triangles.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Leaves in any order, without nodes. Several may have one tile, of which each shows another part.
struct LooseLevel {
  Level level;
  const Level* atlas = nullptr;      ///< whose layers hold the tiles' texels; nullptr: the level's own
  std::vector<Bounds3f> boxes;       ///< of the leaves
  std::vector<std::uint32_t> from;   ///< their numbers in the level they are of
  std::vector<std::uint8_t> is_new;  ///< whether the leaf's primitives are others (1) than there
  std::vector<std::uint32_t> vertices_from;  ///< numbers there of the primitives' vertices, but the last ones
  std::vector<CutEdge> cuts;                 ///< of triangles, by the last cut; `of` is the object
};

LooseLevel loosen(Level&& level);

/// A copy of these leaves, in ascending order, and their primitives; texels stay where they are. `boxes`: of
/// all leaves.
LooseLevel take_leaves(const Level& level, const std::vector<Bounds3f>& boxes,
                       const std::vector<std::uint32_t>& leaves);

struct CutCounts {
  std::uint64_t removed = 0, cut = 0;  ///< leaves that went, and those of which a part went
};

/// Keeps what lies on that side of the box (scan units). Leaves that the box does not meet stay as they are.
/// Of others triangles are cut at its faces (clip_triangles()), discs stay or go by their centres, and tiles
/// keep their texels: boxes of leaves end at the box's faces, to the level's grid.
CutCounts cut_level(LooseLevel& loose, const Bounds3d& box, BoxSide side);

/// Of all leaves; scan units squared. Of a disc the square of its radius.
double surface_area(const LooseLevel& loose);
double surface_area(const Level& level, const std::vector<Bounds3f>& boxes);

}  // namespace rbvh
