// Displaced patch meshes (proxies) and their instances on the device: patches with their bounds, displacement
// maps, and the hierarchies over each mesh's patches and over the instances.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "kernels/common/patch_layout.h"
#include "pipeline/base/affine.h"
#include "pipeline/device/device.h"
#include "pipeline/proxy/patch_levels.h"
#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// Where one of the proxies stands. Its patches are leaves first_leaf, first_leaf + 1 ... of hits.
struct ProxyInstance {
  std::uint32_t proxy = 0;
  Affine to_world;  ///< invertible
  std::uint32_t first_leaf = 0;
};

/// Coarser levels are not used: 16 micro-quads cost as much as one.
inline constexpr std::uint32_t kLeastPatchLevel = 2;

struct PatchScene {
  struct Mesh {  ///< a proxy's patches among all
    std::uint32_t first_patch = 0, patches = 0;
    PatchEdges edges;
    BvhRoot root{};  ///< its box, and where its hierarchy starts
  };
  std::vector<Mesh> meshes;
  std::vector<PatchInstance> instances;
  std::vector<Patch> patches;
  BvhRoot top{};              ///< over the instances
  std::uint32_t stack = 1;    ///< entries that a traversal of these hierarchies can need at most
  std::uint32_t targets = 0;  ///< patches of all instances
  std::size_t map_texels = 0;

  Buffer<WideNode> nodes;
  Buffer<PatchInstance> device_instances;
  Buffer<Patch> device_patches;
  Buffer<PatchParts> device_parts;
  Buffer<float> map;
  Buffer<std::uint32_t>
      links;  ///< of nodes down to PATCH_LINKED_LEVEL: first child << 16 | next when skipped
};

/// Throws Error(kBudget) where the device cannot hold them.
PatchScene upload_patches(const Device& device, std::span<const Proxy* const> proxies,
                          std::span<const ProxyInstance> instances);

/// The instance whose patch the target is.
const PatchInstance& instance_of(const PatchScene& scene, std::uint32_t target);

/// How patches' kernels are built: -D words, work-items of a group, and work-items in all where groups take
/// `jobs` (kernels/common/work_queue.h).
std::string group_options(const Device& device);
std::size_t group_size(const Device& device);
std::size_t queue_items(const Device& device, std::size_t jobs);

}  // namespace rbvh
