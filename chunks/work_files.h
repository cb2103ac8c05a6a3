// The files that a scan is gathered in: its vertices, then its faces.
#pragma once

#include <cstdint>
#include <string>

#include "chunks/big_ply.h"

namespace rbvh {

/// A vertex of any input, in the first one's coordinates.
struct WorkVertex {
  double position[3];
  float normal[3];  ///< 0: not known
  float radius;     ///< 0: not known
  float object_id;
  std::uint8_t color[3];
  std::uint8_t is_dropped;  ///< 1: left out
};
static_assert(sizeof(WorkVertex) == 48);

struct WorkFace {
  Triangle corners;
  std::int32_t object_id;
  std::uint32_t fan;  ///< triangles that are left of its polygon's
};
static_assert(sizeof(WorkFace) == 20);

/// A file of so many vertices as the PLY that it would be with a header. Opened to read and write.
BigPly open_work_vertices(const std::string& path, std::uint64_t count, const std::string& name);

}  // namespace rbvh
