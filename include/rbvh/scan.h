// What comes in: a scan is a triangle mesh or, without triangles, a cloud of oriented discs.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "rbvh/geometry.h"

#pragma GCC visibility push(default)
namespace rbvh {

using Triangle = std::array<std::uint32_t, 3>;
using Color8 = std::array<std::uint8_t, 3>;  ///< red, green, blue, as in the file (sRGB)

/// A further scalar vertex property of the input, carried through by name.
struct ScalarProperty {
  std::string name;
  std::vector<float> values;  ///< one per vertex
};

/// Where the sensor of a cloud stood, in the positions' coordinates.
struct Viewpoint {
  Vec3d position{};
  bool is_default = false;  ///< what writers put in who know of none: the origin of the file's coordinates
  /// The points it belongs to, by object id; all of them unless scans were merged.
  std::int32_t first_object = std::numeric_limits<std::int32_t>::min();
  std::int32_t last_object = std::numeric_limits<std::int32_t>::max();
};

/// A picture that faces show: sRGB, row by row from the top left.
struct TextureImage {
  std::string name;  ///< as the scan's file has it; of one inside of that file what it is called there
  std::string file;  ///< the picture's own file, byte by byte: PNG, JPEG ...
  std::uint32_t width = 0, height = 0;
  std::vector<Color8> texels;
};

/// How a texture goes on beside its image.
enum class TextureWrap : std::uint8_t { kRepeat, kMirror, kClamp };

struct Texture {
  std::shared_ptr<const TextureImage> image;
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  bool times_colors = false;  ///< it multiplies the vertices' colours (in linear light); else it hides them
};

/// What a face shows, and where its corners lie in that: u to the right and v up, (0, 0) and (1, 1) being the
/// image's lower left and upper right corner.
struct FaceTexture {
  static constexpr std::uint32_t kNone = UINT32_MAX;
  std::uint32_t texture = kNone;
  std::array<std::array<float, 2>, 3> corners{};
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
  std::vector<Texture> textures;
  std::vector<FaceTexture> face_textures;   ///< one per triangle, or empty
  std::vector<std::string> texture_faults;  ///< what textures its file has and could not be had, in words
  std::vector<Viewpoint> viewpoints;        ///< at most one for each file that was merged
  std::string units;                        ///< of the coordinates: mm, cm, m, km, in or ft; empty: not known
};

/// A scan as a file has it, before its coordinates are made small enough for float.
struct RawScan : ScanAttributes {
  std::vector<Vec3d> positions;
  Vec3d shift{};                   ///< already subtracted from the positions by an earlier ingest
  std::vector<std::string> notes;  ///< what the file has that a scan cannot hold, a sentence each
};

/// A scan in float: original coordinates are positions + shift.
struct Scan : ScanAttributes {
  std::vector<Vec3f> positions;
  Vec3d shift{};

  bool is_cloud() const { return triangles.empty(); }
};

/// Bounds of the finite positions; a cloud's discs are not counted in.
Bounds3f bounds(const Scan& scan);

/// Narrows the positions to float, after subtracting a shift when max|coordinate| > 16 x diagonal of the
/// finite positions. The shift is the bounds' centre rounded to whole units, so that it prints exactly.
Scan shift_to_float(RawScan&& raw);

/// Into the coordinates of another shift: an ingested scan's own may differ from that of the file it came
/// from.
void move_to_shift(Scan& scan, const Vec3d& shift);

}  // namespace rbvh
#pragma GCC visibility pop
