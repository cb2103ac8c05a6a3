// Which patch hierarchies are on the device: the level of detail each patch is wanted at, the hierarchies
// that are built, in a cache of bounded size (patch_cache.h), and those still to be built for the work items
// at hand.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/common/patch_layout.h"
#include "pipeline/device/device.h"
#include "pipeline/proxy/patch_levels.h"
#include "pipeline/trace/patch_cache.h"
#include "pipeline/trace/patch_scene.h"

namespace rbvh {

struct PatchResidency {
  std::vector<PatchLevel> wanted;
  std::vector<PatchLevel> built;
  std::vector<PatchSlot> slots;  ///< at: PATCH_NOT_BUILT also where another level is built than is wanted
  Buffer<PatchSlot> device_slots;
  bool slots_changed = true;                ///< since they were uploaded
  std::vector<std::uint32_t> unbuilt_rays;  ///< that reached each patch since it was last built

  PatchCache cache;
  Buffer<PatchBlock> memory;

  std::vector<PatchBuild> builds;    ///< to be done before the next cast
  std::vector<std::uint8_t> needed;  ///< patches of the next cast: they stay
  std::uint64_t evicted = 0;         ///< hierarchies that others have replaced
};

PatchResidency make_residency(const Device& device, const PatchScene& scene, std::size_t cache_bytes);

/// One level for each patch; borders take the coarser neighbour's. Hierarchies of other levels no longer
/// count as built. True where there were such.
bool set_levels(PatchResidency& residency, const PatchScene& scene, std::span<const std::uint32_t> levels);

/// The levels whose micro-quads measure about `pixels` pixels of the camera in each patch's nearest point.
std::vector<std::uint32_t> levels_for(const PatchScene& scene, const CameraRays& camera, double pixels);

/// Drops all hierarchies.
void clear(PatchResidency& residency);

void upload_slots(PatchResidency& residency);

/// Of the patch's hierarchy at the wanted level, in blocks.
std::uint32_t blocks_of(const Device& device, const PatchResidency& residency, std::uint32_t patch);

/// Whether rays can be cast at the patch without its hierarchy. Coarse ones are built as fast as intersected.
bool can_do_without(const PatchScene& scene, const PatchResidency& residency, std::uint32_t patch);

/// Whether building the patch for `rays` more does not pay: at most `few_rays` have reached it since it was
/// last built. Counts them.
bool does_without(const PatchScene& scene, PatchResidency& residency, std::uint32_t patch, std::uint32_t rays,
                  std::uint32_t few_rays);

/// Makes sure that the patch is built, or among `builds`. False where what is needed already leaves no room.
bool provide(const Device& device, PatchResidency& residency, std::uint32_t patch);

/// A PatchLevel's borders as PatchBuild.edges.
std::uint32_t packed_edges(const PatchLevel& level);

}  // namespace rbvh
