// A level of a pair as its tracer wants it: one hierarchy whose leaves are tiles and blocks of primitives
// (kernels/trace/level_tree.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/bvh/bvh_layout.h"
#include "kernels/common/layout.h"
#include "pipeline/bvh/wide_bvh.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

struct LevelTree {
  WideBvh wide;                 ///< a leaf's number is a tile's or, after these, a block's
  std::vector<RbvhTile> tiles;  ///< at least one
  std::uint32_t tile_count = 0;
  std::vector<std::uint16_t> heights;  ///< of the tiles, and one more: kernels read past the last
  std::vector<std::byte> blocks;       ///< at least one
  std::string block_options;           ///< which kind of blocks, as kernels' -D words
};

LevelTree make_level_tree(const Level& level);

}  // namespace rbvh
