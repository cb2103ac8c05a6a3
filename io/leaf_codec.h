// The streams of a level's hierarchy and its leaves (docs/file_format.md, "Streams").
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/stream_codec.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// How many there are of what the streams hold; a reader bounds them before it decodes.
struct LevelCounts {
  std::uint32_t leaves = 0, primitive_leaves = 0, vertices = 0, triangles = 0;
};

/// Throws Error(kFailure), naming `path`, where the leaves are not numbered from left to right.
ByteVector encode_tree(const Level& level, const std::string& path);
/// Nodes with the boxes of the leaves, numbered as build_leaf_hierarchy() does. False where the stream is no
/// such tree.
bool decode_tree(const ByteVector& packed, const std::vector<Bounds3f>& boxes, Level& level);

ByteVector encode_leaves(const Level& level);
/// Leaves and leaves of primitives. `boxes`: of the tiles; on a grid those of leaves of primitives are left
/// empty. False where the stream does not hold the leaves that are counted.
bool decode_leaves(const ByteVector& packed, const LevelCounts& counts, Level& level,
                   std::vector<Bounds3f>& boxes);

}  // namespace rbvh
