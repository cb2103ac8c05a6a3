// Imports assets of other programs: any polygon mesh with texture coordinates and a displacement map,
// resampled to a proxy's tiles.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/proxy/polygon_mesh.h"
#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// What a map's vectors are relative to. An OBJ has no transform of its own, so world is object.
enum class VdmSpace { kObject, kWorld, kTangent };

/// Which axis a channel holds: x y z, or tangent, bitangent, normal; and its sign.
struct VdmAxis {
  int axis = 0;
  double sign = 1;
};

/// displacement = scale * (value - midlevel), channel by channel.
struct VdmConvention {
  VdmSpace space = VdmSpace::kObject;
  std::array<VdmAxis, 3> order = {{{0, 1}, {1, 1}, {2, 1}}};  ///< of the channels R, G, B
  double scale = 1, midlevel = 0;
};

/// "xzy", "tnb", "x-zy": three different axes, each with a minus sign where it is reversed. Throws
/// Error(kUsage).
std::array<VdmAxis, 3> parse_vdm_order(std::string_view text);

/// As programs document their maps (see docs/proxy.md). Object and world maps are x, y, z and zero-based in
/// all of them. Throws Error(kUsage) for an unknown name.
VdmConvention vdm_preset(std::string_view name, VdmSpace space);

/// What a user may say of a map.
struct VdmWords {
  std::string preset;  ///< vdm_preset()'s name, or empty
  std::optional<VdmSpace> space;
  std::optional<std::array<VdmAxis, 3>> order;
  std::optional<double> scale, midlevel;

  bool any() const { return space || order || scale || midlevel || !preset.empty(); }
};

/// What is said goes before the preset, which is of tangent space unless said otherwise; without one the
/// defaults are VdmConvention's. Throws as vdm_preset().
VdmConvention vdm_convention(const VdmWords& words);

struct VdmMap {
  std::uint32_t width = 0, height = 0;
  std::uint32_t channels = 3;  ///< 3: vectors; 1: heights along the normal
  bool is_integer = false;     ///< in the file; values are then 0 to 1
  std::vector<float> values;   ///< row by row, row 0 on top
};

struct ImportConfig {
  VdmConvention convention;
  std::uint32_t max_side = 257;  ///< texels a side of a tile at most: 2^k + 1
  std::uint64_t max_texels = std::uint64_t{1} << 28;
};

/// What the import found and did.
struct ImportReport {
  std::uint64_t faces = 0, patches = 0, texels = 0;
  std::uint64_t split_faces = 0;        ///< that are no quads; then all faces are split around their centres
  std::uint64_t dropped_faces = 0;      ///< with fewer than three different corners
  std::uint64_t zero_area_patches = 0;  ///< kept
  std::uint64_t bad_texels = 0;         ///< NaN or infinite: no displacement there
  std::uint64_t welded_edges = 0;       ///< where two patches differed: they got the mean
  std::uint64_t overlapping_patches = 0;  ///< that overlap others in the map by at least a quarter: kept
  std::uint64_t coarser_patches = 0;      ///< that have fewer texels than the map has for them
  std::uint64_t long_patches = 0;         ///< displaced by more than the mesh's diagonal: kept
  double longest_displacement = 0, diagonal = 0;
  Vec3d shift{};  ///< subtracted from the positions, as from a scan's
};

/// `file` is for messages. Throws Error(kInput) for faces without texture coordinates, for positions that are
/// not finite, for an integer map of vectors whose midlevel is 0; Error(kBudget) over max_texels. The proxy
/// has no find_fault().
Proxy import_vdm(const PolygonMesh& mesh, const VdmMap& map, const ImportConfig& config,
                 const std::string& file, ImportReport& counts);

}  // namespace rbvh
