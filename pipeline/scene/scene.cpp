#include "pipeline/scene/scene.h"

#include "kernels/common/layout.h"
#include "pipeline/base/error.h"
#include "pipeline/scan/float_shift.h"

namespace rbvh {

std::size_t leaf_count(const SceneObject& object) {
  if (const Scan* scan = object.scan())
    return scan->is_cloud() ? scan->positions.size() : scan->triangles.size();
  if (const Level* level = object.level()) return level->leaves.size();
  if (const LevelOnDemand* level = object.on_demand()) return level->leaves;
  return object.proxy()->quads.size();
}

std::vector<std::uint32_t> first_leaves(const Scene& scene) {
  std::vector<std::uint32_t> first = {0};
  for (const SceneInstance& instance : scene.instances) {
    const std::uint64_t next = std::uint64_t{first.back()} + leaf_count(scene.objects[instance.object]);
    if (next >= RBVH_NO_LEAF)
      throw Error(ErrorKind::kBudget, {}, "more than 2^32 leaves in all instances; leave some out");
    first.push_back(static_cast<std::uint32_t>(next));
  }
  return first;
}

void choose_frame(Scene& scene) {
  Bounds3d all;
  bool shifted = false;
  for (const SceneInstance& instance : scene.instances) {
    const SceneObject& object = scene.objects[instance.object];
    shifted |= object.shift != Vec3d{};
    if (!object.bounds.empty())
      all.add(transformed(instance.to_world,
                          {Vec3d(object.bounds.lo) + object.shift, Vec3d(object.bounds.hi) + object.shift}));
  }
  if (!shifted) return;
  scene.shift = float_shift(all);
  for (SceneInstance& instance : scene.instances) {
    const Vec3d move = instance.to_world.vector(scene.objects[instance.object].shift) - scene.shift;
    for (std::size_t row = 0; row < 3; ++row) instance.to_world.m[4 * row + 3] += move[static_cast<int>(row)];
  }
}

Bounds3f bounds(const Scene& scene) {
  Bounds3d all;
  for (const SceneInstance& instance : scene.instances) {
    const Bounds3f& box = scene.objects[instance.object].bounds;
    if (!box.empty())
      all.add(transformed(instance.to_world, {static_cast<Vec3d>(box.lo), static_cast<Vec3d>(box.hi)}));
  }
  if (all.empty()) return {};
  return {static_cast<Vec3f>(all.lo), static_cast<Vec3f>(all.hi)};
}

}  // namespace rbvh
