#include "rbvh/asset.h"

#include <utility>

#include "pipeline/scene/asset_content.h"

namespace rbvh {
namespace {

template <class T>
T* get_if(const std::shared_ptr<AssetContent>& content) {
  return content ? std::get_if<T>(&content->value) : nullptr;
}

template <class T>
Asset hold(T&& value, const Bounds3f& bounds, bool is_cloud) {
  Asset asset;
  asset.bounds = bounds;
  asset.is_cloud = is_cloud;
  asset.content = std::make_shared<AssetContent>(AssetContent{std::forward<T>(value)});
  return asset;
}

}  // namespace

Rbvh* Asset::rbvh() const { return get_if<Rbvh>(content); }
Scan* Asset::scan() const { return get_if<Scan>(content); }
Scene* Asset::scene() const { return get_if<Scene>(content); }

Vec3d Asset::up_axis() const {
  return is_cloud || (scene() != nullptr && scene()->z_is_up) ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0};
}

Asset make_asset(Scan&& scan, const std::string& name) {
  const Bounds3f box = bounds(scan);
  const bool is_cloud = scan.is_cloud();
  Asset asset = hold(std::move(scan), box, is_cloud);
  asset.name = name;
  return asset;
}

Asset make_asset(Rbvh&& rbvh) {
  const Bounds3f box = rbvh.source.bounds;
  const bool is_cloud = rbvh.source.triangles == 0;
  return hold(std::move(rbvh), box, is_cloud);
}

Asset make_asset(Scene&& scene) {
  const Bounds3f box = bounds(scene);
  return hold(std::move(scene), box, false);
}

std::vector<std::string> level_names(const Asset& asset) {
  std::vector<std::string> names;
  if (const Rbvh* rbvh = asset.rbvh())
    for (const Level& level : rbvh->levels) names.push_back(level.name);
  return names;
}

std::vector<std::string> texture_faults(const Asset& asset) {
  if (const Scan* scan = asset.scan()) return scan->texture_faults;
  std::vector<std::string> all;
  const Scene* scene = asset.scene();
  for (std::size_t i = 0; scene != nullptr && i < scene->objects.size(); ++i)
    if (const Scan* scan = scene->objects[i].scan())
      for (const std::string& fault : scan->texture_faults)
        all.push_back("object \"" + scene->objects[i].name + "\": " + fault);
  return all;
}

}  // namespace rbvh
