#include "pipeline/trace/patch_residency.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rbvh {
namespace {

constexpr std::uint32_t kLeastUnbuiltLevel = 4;

/// Blocks and vertices. `wide`: as a CPU has them (kernels/trace/patch_surface.h).
std::uint32_t slot_blocks(std::uint32_t level, bool wide) {
  const bool has_grids = wide && level >= 2;
  const std::uint32_t boxes = has_grids ? level - 1 : level;
  const std::uint32_t blocks =
      boxes == 0 ? 1 : static_cast<std::uint32_t>(((std::uint64_t{4} << 2 * boxes) + 32) / 48);
  if (has_grids) return blocks + (1u << 2 * (level - 2));
  const std::size_t side = (std::size_t{1} << level) + 1;
  const std::size_t floats = 3 * side * side + 2;  // kernels read a little past the last one
  return blocks +
         static_cast<std::uint32_t>((floats * sizeof(float) + sizeof(PatchBlock) - 1) / sizeof(PatchBlock));
}

/// Distance from a point to the patch's box.
double distance_to(const Patch& patch, const Vec3d& at) {
  double square = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double lo = patch.lo[axis], hi = patch.hi[axis];
    const double gap = std::max({lo - at[axis], at[axis] - hi, 0.0});
    square += gap * gap;
  }
  return std::sqrt(square);
}

}  // namespace

PatchResidency make_residency(const Device& device, const PatchScene& scene, std::size_t cache_bytes) {
  const std::size_t count = scene.patches.size();
  PatchResidency residency;
  residency.wanted.resize(count);
  residency.built.resize(count);
  residency.unbuilt_rays.assign(count, 0);
  residency.slots.assign(count, {PATCH_NOT_BUILT, 0});
  residency.device_slots = {device, count};
  residency.needed.assign(count, 0);
  residency.cache = PatchCache(
      static_cast<std::uint32_t>(std::min<std::size_t>(cache_bytes / sizeof(PatchBlock), 0xfffffff0u)));
  residency.memory = {device, residency.cache.capacity()};
  return residency;
}

bool set_levels(PatchResidency& residency, const PatchScene& scene, std::span<const std::uint32_t> levels) {
  for (const PatchScene::Mesh& mesh : scene.meshes) {
    const std::vector<PatchLevel> matched =
        match_borders(mesh.edges, levels.subspan(mesh.first_patch, mesh.patches));
    std::copy(matched.begin(), matched.end(), residency.wanted.begin() + mesh.first_patch);
  }
  bool lost = false;
  for (std::size_t p = 0; p < residency.slots.size(); ++p) {
    if (residency.slots[p].at == PATCH_NOT_BUILT || residency.built[p] == residency.wanted[p]) continue;
    residency.slots[p].at = PATCH_NOT_BUILT;
    lost = true;
  }
  residency.slots_changed = true;
  return lost;
}

std::vector<std::uint32_t> levels_for(const PatchScene& scene, const CameraRays& camera, double pixels) {
  const Vec3d right = {camera.right[0], camera.right[1], camera.right[2]};
  const Vec3d eye = {camera.position[0], camera.position[1], camera.position[2]};
  const double spread = pixels * length(right);
  std::vector<std::uint32_t> levels(scene.patches.size(), 0);
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const PatchInstance& instance = scene.instances[i];
    Affine to_object;
    for (std::size_t k = 0; k < 12; ++k) to_object.m[k] = static_cast<double>(instance.to_object[k]);
    const Vec3d at = to_object.point(eye);
    const std::uint32_t end =
        i + 1 < scene.instances.size() ? scene.instances[i + 1].first_target : scene.targets;
    for (std::uint32_t patch = instance.first_patch;
         patch < instance.first_patch + (end - instance.first_target); ++patch) {
      const Patch& p = scene.patches[patch];
      const double pieces =
          static_cast<double>(p.size) / (spread * distance_to(p, at)) * std::numbers::sqrt2 / 2;
      std::uint32_t level = std::min(kLeastPatchLevel, p.level);
      while (level < p.level && !(static_cast<double>(1u << level) >= pieces)) ++level;
      levels[patch] = std::max(levels[patch], level);
    }
  }
  return levels;
}

void clear(PatchResidency& residency) {
  residency.cache.clear();
  for (PatchSlot& slot : residency.slots) slot.at = PATCH_NOT_BUILT;
  std::fill(residency.unbuilt_rays.begin(), residency.unbuilt_rays.end(), 0);
  residency.slots_changed = true;
}

void upload_slots(PatchResidency& residency) {
  if (!residency.slots_changed) return;
  residency.device_slots.enqueue_write(residency.slots);
  residency.slots_changed = false;
}

std::uint32_t blocks_of(const Device& device, const PatchResidency& residency, std::uint32_t patch) {
  return slot_blocks(residency.wanted[patch].level, device.info().is_cpu);
}

bool can_do_without(const PatchScene& scene, const PatchResidency& residency, std::uint32_t patch) {
  return residency.wanted[patch].level >= kLeastUnbuiltLevel && scene.patches[patch].loose == 0;
}

bool does_without(const PatchScene& scene, PatchResidency& residency, std::uint32_t patch, std::uint32_t rays,
                  std::uint32_t few_rays) {
  if (residency.slots[patch].at != PATCH_NOT_BUILT || !can_do_without(scene, residency, patch) ||
      rays > few_rays)
    return false;
  residency.unbuilt_rays[patch] += rays;
  return residency.unbuilt_rays[patch] <= few_rays;
}

bool provide(const Device& device, PatchResidency& residency, std::uint32_t patch) {
  PatchSlot& slot = residency.slots[patch];
  if (slot.at == PATCH_NOT_BUILT) {
    const PatchLevel& level = residency.wanted[patch];
    const std::uint32_t blocks = blocks_of(device, residency, patch);
    std::vector<PatchCache::Entry> evicted;
    const std::uint32_t at = residency.cache.allocate(
        patch, blocks,
        [&](const PatchCache::Entry& e) {
          return residency.needed[e.patch] && residency.slots[e.patch].at == e.at;
        },
        evicted);
    for (const PatchCache::Entry& e : evicted) {
      if (residency.slots[e.patch].at != e.at) continue;
      residency.slots[e.patch].at = PATCH_NOT_BUILT;
      ++residency.evicted;
    }
    residency.slots_changed = true;
    if (at == PatchCache::kNone) return false;
    slot = {at, level.level};
    residency.built[patch] = level;
    residency.unbuilt_rays[patch] = 0;
    residency.builds.push_back({patch, at, level.level, packed_edges(level)});
  }
  residency.needed[patch] = 1;
  return true;
}

std::uint32_t packed_edges(const PatchLevel& level) {
  return level.edges[0] | level.edges[1] << 8 | level.edges[2] << 16 | level.edges[3] << 24;
}

}  // namespace rbvh
