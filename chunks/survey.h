// What has to be known of a whole scan before it is cut into cells: two passes over its file.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "chunks/big_ply.h"
#include "rbvh/geometry.h"
#include "rbvh/progress.h"

namespace rbvh {

struct ScanSurvey {
  BigPly ply;
  std::uint64_t hash = 0;         ///< of the file's bytes
  std::uint64_t source_hash = 0;  ///< of the files that it was gathered from, else the same
  Vec3d moved{};                  ///< subtracted from the file's coordinates, so that floats hold them
  Vec3d shift{};                  ///< original coordinates are the floats + shift
  Bounds3f box;                   ///< of the vertices, as floats
};

/// Reads the file once. Throws Error(kInput) as check_buildable() and check_usable() do.
ScanSurvey survey_scan(const BigPly& ply, const Progress& progress = {});

/// Boxes of equal size over the scan's bounds, kGridSide along each axis, with the number of primitives whose
/// centres lie in them.
inline constexpr int kGridSide = 128;
struct SpaceGrid {
  Vec3f lo{}, boxes_per_unit{};
  Vec3f box{};                        ///< the size of one
  std::vector<std::uint32_t> counts;  ///< x + kGridSide * (y + kGridSide * z)

  std::array<int, 3> place(Vec3f p) const {
    std::array<int, 3> at{};
    for (int axis = 0; axis < 3; ++axis) {
      const float boxes = (p[axis] - lo[axis]) * boxes_per_unit[axis];
      at[static_cast<std::size_t>(axis)] = static_cast<int>(
          std::clamp(boxes, 0.0f, static_cast<float>(kGridSide - 1)));  // the order of floats is kept
    }
    return at;
  }
  static std::size_t index(const std::array<int, 3>& at) {
    return static_cast<std::size_t>(at[0] + kGridSide * (at[1] + kGridSide * at[2]));
  }
};

/// Without counts.
SpaceGrid place_grid(const Bounds3f& box);

struct ScanMap {
  SpaceGrid grid;
  double area = 0;   ///< of the triangles; of a cloud the sum of its radii's squares; scan units squared
  float radius = 0;  ///< of a cloud, the largest
  float reach = 0;   ///< of triangles, the farthest that one reaches from its centre along an axis
};

/// A primitive, for whoever cuts the scan.
struct PassedPrimitive {
  Triangle corners{};  ///< of a disc: three times its point
  std::int32_t object_id = 0;
  Bounds3f box;  ///< of the corners
  Vec3f center;
  double area = 0;  ///< as ScanMap's
  float radius = 0;
};

/// All primitives in their order; `cache_bytes`: for the vertices of triangles.
void for_each_primitive(const ScanSurvey& survey, std::uint64_t cache_bytes,
                        const std::function<void(const PassedPrimitive&)>& visit,
                        const std::function<void(double fraction)>& on_piece);

/// Passes over the primitives once.
ScanMap map_scan(const ScanSurvey& survey, std::uint64_t cache_bytes, const Progress& progress = {});

}  // namespace rbvh
