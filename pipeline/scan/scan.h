// What comes in: a scan is a triangle mesh or, without triangles, a cloud of oriented discs.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/base/vec.h"

namespace rbvh {

using Triangle = std::array<std::uint32_t, 3>;
using Color8 = std::array<std::uint8_t, 3>;  ///< red, green, blue, as in the file (sRGB)

/// A further scalar vertex property of the input, carried through by name.
struct ScalarProperty {
  std::string name;
  std::vector<float> values;  ///< one per vertex
};

/// What every scan carries beside its positions. Per-vertex arrays are empty or as long as the positions.
struct ScanAttributes {
  std::vector<Vec3f> normals;
  std::vector<float> radii;  ///< disc radius in scan units; clouds only
  std::vector<Color8> colors;
  std::vector<ScalarProperty> properties;
  std::vector<Triangle> triangles;  ///< empty: a cloud
  std::vector<std::int32_t>
      object_ids;  ///< one per triangle (mesh) or per point (cloud), or empty: one object
};

/// A scan as a file has it, before its coordinates are made small enough for float.
struct RawScan : ScanAttributes {
  std::vector<Vec3d> positions;
  Vec3d shift{};  ///< already subtracted from the positions by an earlier ingest
  bool has_viewpoint = false;
  Vec3d viewpoint{};                  ///< where the sensor stood, in the positions' coordinates
  bool viewpoint_is_default = false;  ///< the file has what writers put in who know of none: the origin
  std::vector<std::string> notes;     ///< what the file has that a scan cannot hold, a sentence each
};

/// A scan in float: original coordinates are positions + shift.
struct Scan : ScanAttributes {
  std::vector<Vec3f> positions;
  Vec3d shift{};
  bool has_viewpoint = false;
  Vec3f viewpoint{};

  bool is_cloud() const { return triangles.empty(); }
};

/// Bounds of the finite positions; a cloud's discs are not counted in.
Bounds3f bounds(const Scan& scan);

/// Narrows the positions to float, after subtracting a shift when max|coordinate| > 16 x diagonal of the
/// finite positions. The shift is the bounds' centre rounded to whole units, so that it prints exactly.
Scan shift_to_float(RawScan&& raw);

}  // namespace rbvh
