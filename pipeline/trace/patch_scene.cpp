#include "pipeline/trace/patch_scene.h"

#include <algorithm>
#include <limits>

#include "pipeline/base/error.h"
#include "pipeline/bvh/wide_bvh.h"

namespace rbvh {
namespace {

constexpr std::size_t kGpuGroup = 64;
constexpr std::uint32_t kCpuGroupsPerUnit = 4;

std::vector<std::uint32_t> make_links() {
  constexpr std::uint32_t kNodes = ((1u << 2 * (PATCH_LINKED_LEVEL + 1)) - 1) / 3, kEnd = 0xffff;
  std::vector<std::uint32_t> links(kNodes);
  for (std::uint32_t node = 0; node < kNodes; ++node) {
    std::uint32_t up = node;
    while (up != 0 && up % 4 == 0) up = (up - 1) / 4;
    const std::uint32_t skip = up == 0 ? kEnd : up + 1, child = 4 * node + 1;
    links[node] = (child < kNodes ? child : 0) << 16 | skip;
  }
  return links;
}

/// Patches whose borders may leave their parts: they or a neighbour can be coarser than 4 x 4.
std::vector<std::uint32_t> loose_patches(const Proxy& proxy, const PatchEdges& edges) {
  const std::vector<PatchLevel> levels = match_borders(edges, uniform_levels(proxy, kLeastPatchLevel));
  std::vector<std::uint32_t> loose;
  for (const PatchLevel& level : levels) {
    const std::uint32_t least = *std::min_element(level.edges.begin(), level.edges.end());
    loose.push_back(std::min(least, level.level) < kLeastPatchLevel ? 1 : 0);
  }
  return loose;
}

void add_mesh(PatchScene& scene, const Proxy& proxy) {
  PatchScene::Mesh mesh;
  mesh.first_patch = static_cast<std::uint32_t>(scene.patches.size());
  mesh.patches = static_cast<std::uint32_t>(proxy.quads.size());
  mesh.edges = find_edges(proxy);
  const std::vector<std::uint32_t> loose = loose_patches(proxy, mesh.edges);
  for (std::size_t i = 0; i < proxy.quads.size(); ++i) {
    Patch patch{};
    for (std::size_t k = 0; k < 4; ++k)
      for (int axis = 0; axis < 3; ++axis) patch.corners[k][axis] = proxy.positions[proxy.quads[i][k]][axis];
    const std::size_t texel =
        scene.map_texels + std::size_t{proxy.tiles[i].y} * proxy.map_width + proxy.tiles[i].x;
    if (texel > std::numeric_limits<std::uint32_t>::max())
      throw Error(ErrorKind::kBudget, {},
                  "displacement maps of more than 2^32 texels; use fewer or smaller ones");
    patch.texels = static_cast<std::uint32_t>(texel);
    patch.row = proxy.map_width;
    patch.level = tile_level(proxy.tiles[i]);
    patch.loose = loose[i];
    scene.patches.push_back(patch);
  }
  scene.map_texels += proxy.map.size();
  scene.meshes.push_back(std::move(mesh));
}

void upload_maps(const Device& device, PatchScene& scene, std::span<const Proxy* const> proxies) {
  scene.map = {device, 3 * scene.map_texels + 16};  // kernels read a little past the last one
  std::size_t at = 0;
  for (const Proxy* proxy : proxies) {
    scene.map.write({&proxy->map.data()->x, 3 * proxy->map.size()}, at);
    at += 3 * proxy->map.size();
  }
}

/// Patches' boxes and their parts' need the displaced vertices: the device computes them.
void bound_patches(const Device& device, PatchScene& scene) {
  const std::size_t count = scene.patches.size();
  scene.device_patches = {device, scene.patches};
  scene.device_parts = {device, count};
  if (count == 0) return;
  device.kernel("build/build_patches", "bound_patches", group_options(device))
      .run(count, group_size(device), scene.device_patches, static_cast<std::uint32_t>(count), scene.map,
           scene.device_parts);
  scene.device_patches.read(scene.patches);
}

std::uint32_t relinked(std::uint32_t child, std::uint32_t base) {
  return child & BVH_LEAF_BIT ? child : child + base;
}

/// Puts a hierarchy behind `all`.
void append_nodes(std::vector<WideNode>& all, WideBvh& wide) {
  const auto base = static_cast<std::uint32_t>(all.size());
  for (WideNode& node : wide.nodes) {
    for (std::uint32_t& child : node.children) child = relinked(child, base);
    all.push_back(node);
  }
  wide.scene.root = relinked(wide.scene.root, base);
}

/// Over each mesh's patches.
std::vector<WideNode> build_mesh_nodes(PatchScene& scene) {
  std::vector<WideNode> nodes;
  for (PatchScene::Mesh& mesh : scene.meshes) {
    std::vector<Bounds3f> boxes(mesh.patches);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      const Patch& p = scene.patches[mesh.first_patch + i];
      boxes[i] = {{p.lo[0], p.lo[1], p.lo[2]}, {p.hi[0], p.hi[1], p.hi[2]}};
    }
    WideBvh wide = build_wide_bvh(boxes);
    append_nodes(nodes, wide);
    mesh.root = wide.scene;
    scene.stack = std::max(scene.stack, wide.stack);
  }
  return nodes;
}

/// Returns the instance's box in the world.
Bounds3f add_instance(PatchScene& scene, const ProxyInstance& instance) {
  const PatchScene::Mesh& mesh = scene.meshes[instance.proxy];
  if (std::uint64_t{scene.targets} + mesh.patches >= PATCH_NOT_BUILT)
    throw Error(ErrorKind::kBudget, {}, "more than 2^32 patches in all instances; leave some out");
  PatchInstance placed{};
  const Affine to_object = inverse(instance.to_world);
  for (std::size_t i = 0; i < 12; ++i) placed.to_object[i] = static_cast<float>(to_object.m[i]);
  std::copy_n(mesh.root.lo, 3, placed.lo);
  std::copy_n(mesh.root.hi, 3, placed.hi);
  placed.root = mesh.root.root;
  placed.first_target = scene.targets;
  placed.first_patch = mesh.first_patch;
  placed.first_leaf = instance.first_leaf;
  scene.targets += mesh.patches;
  scene.instances.push_back(placed);
  const Bounds3d image = transformed(instance.to_world, {{placed.lo[0], placed.lo[1], placed.lo[2]},
                                                         {placed.hi[0], placed.hi[1], placed.hi[2]}});
  const double pad = 1e-6 * std::max(length(image.lo), length(image.hi));
  Bounds3f padded;
  padded.add(static_cast<Vec3f>(image.lo - Vec3d{pad, pad, pad}));
  padded.add(static_cast<Vec3f>(image.hi + Vec3d{pad, pad, pad}));
  return padded;
}

}  // namespace

std::string group_options(const Device& device) {
  return device.info().is_cpu ? std::string("-DGROUP=1 -DWIDE") : "-DGROUP=" + std::to_string(kGpuGroup);
}

std::size_t group_size(const Device& device) { return device.info().is_cpu ? 1 : kGpuGroup; }

std::size_t queue_items(const Device& device, std::size_t jobs) {
  if (!device.info().is_cpu) return jobs * kGpuGroup;
  return std::min(std::size_t{device.info().compute_units} * kCpuGroupsPerUnit, jobs);
}

PatchScene upload_patches(const Device& device, std::span<const Proxy* const> proxies,
                          std::span<const ProxyInstance> instances) {
  PatchScene scene;
  for (const Proxy* proxy : proxies) add_mesh(scene, *proxy);
  upload_maps(device, scene, proxies);
  bound_patches(device, scene);
  const std::vector<WideNode> mesh_nodes = build_mesh_nodes(scene);
  std::vector<Bounds3f> boxes;
  for (const ProxyInstance& instance : instances)
    if (scene.meshes.at(instance.proxy).patches > 0) boxes.push_back(add_instance(scene, instance));
  WideBvh wide = build_wide_bvh(boxes);
  scene.top = wide.scene;
  scene.stack = std::max(scene.stack, wide.stack);
  // The top hierarchy's nodes come first.
  const auto base = static_cast<std::uint32_t>(wide.nodes.size());
  for (WideNode node : mesh_nodes) {
    for (std::uint32_t& child : node.children) child = relinked(child, base);
    wide.nodes.push_back(node);
  }
  for (PatchInstance& placed : scene.instances) placed.root = relinked(placed.root, base);
  scene.nodes = {device, wide.nodes};
  scene.device_instances = {device, scene.instances};
  scene.links = {device, make_links()};
  return scene;
}

const PatchInstance& instance_of(const PatchScene& scene, std::uint32_t target) {
  return *(
      std::upper_bound(scene.instances.begin(), scene.instances.end(), target,
                       [](std::uint32_t t, const PatchInstance& placed) { return t < placed.first_target; }) -
      1);
}

}  // namespace rbvh
