#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/frame.h"
#include "rbvh/scene.h"

namespace rbvh {
namespace {

SceneObject object_of(const PlacedAsset& placed) {
  const Asset& asset = placed.asset;
  if (const Scene* scene = asset.scene()) {
    if (scene->objects.size() != 1)
      throw Error(ErrorKind::kUsage, asset.path, "is a scene itself; place its objects");
    return scene->objects[0];
  }
  SceneObject object;
  object.name = asset.name;
  object.bounds = asset.bounds;
  object.shift = shift(asset);
  if (const Rbvh* rbvh = asset.rbvh()) {
    const Level* level = rbvh->find_level(placed.level);
    if (level == nullptr)
      throw Error(ErrorKind::kUsage, asset.path, "there is no level '" + placed.level + "'");
    object.content = *level;
  } else {
    RBVH_CHECK(asset.scan() != nullptr);
    object.content = *asset.scan();
  }
  return object;
}

}  // namespace

std::vector<std::uint32_t> first_leaves(const Asset& asset) {
  if (const Scene* scene = asset.scene()) return first_leaves(*scene);
  return {0};
}

Asset make_scene(std::span<const PlacedAsset> placed, bool z_is_up) {
  Scene scene;
  scene.z_is_up = z_is_up;
  for (const PlacedAsset& each : placed) {
    SceneInstance instance;
    instance.object = static_cast<std::uint32_t>(scene.objects.size());
    instance.to_world.m = each.to_world;
    const double determinant = instance.to_world.determinant();
    if (!instance.to_world.is_finite() || !std::isfinite(determinant) || determinant == 0)
      throw Error(ErrorKind::kUsage, each.asset.path, "is placed by a map that is not invertible");
    scene.objects.push_back(object_of(each));
    scene.instances.push_back(instance);
  }
  choose_frame(scene);
  return make_asset(std::move(scene));
}

}  // namespace rbvh
