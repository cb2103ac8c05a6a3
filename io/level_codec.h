// A level's hierarchy, leaves and primitives as the compressed streams that NAME.rbvh has of them
// (docs/file_format.md, "Streams").
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/leaf_codec.h"
#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

LevelCounts level_counts(const Level& level);

struct LevelStreams {
  std::vector<std::uint8_t> tree, leaves, positions, normals, colors, radii, triangles;
};
std::uint64_t stream_bytes(const LevelStreams& streams);
StreamBytes bytes_by_stream(const LevelStreams& streams);

/// Frames and boxes are rounded to the level's grid, positions to its lattice, as a build has rounded them
/// already. Throws Error(kFailure), naming `path`, for a tree whose leaves are not numbered from left to
/// right.
LevelStreams encode_streams(const Level& level, const std::string& path);

/// Fills in nodes, leaves, primitive_leaves and primitives of a level whose grid, lattice and rho are known.
/// `area`: of the source. Bytes may be hostile: what comes out has the given counts and takes at most 1100
/// times their bytes, but must be checked (check_rbvh.h). Throws Error(kInput), naming `path`.
void decode_streams(const LevelStreams& streams, const LevelCounts& counts, double area,
                    const std::string& path, Level& level);

}  // namespace rbvh
