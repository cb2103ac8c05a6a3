// What a file holds, whatever its kind: a scan, a pair, or a scene. A proxy is a scene of one object.
#pragma once

#include <string>
#include <variant>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/scan.h"
#include "pipeline/scene/scene.h"

namespace rbvh {

struct Asset {
  std::string path;
  std::string name;  ///< without folders and extension
  std::variant<Rbvh, Scan, Scene> content;
  Bounds3f bounds;
  bool is_cloud = false;

  const Rbvh* rbvh() const { return std::get_if<Rbvh>(&content); }
  const Scan* scan() const { return std::get_if<Scan>(&content); }
  const Scene* scene() const { return std::get_if<Scene>(&content); }
  Vec3d up_axis() const {
    return is_cloud || (scene() && scene()->z_is_up) ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0};
  }
};

/// Of contents in memory. `path` is for messages.
inline Asset make_asset(Scan&& scan, const std::string& path) {
  Asset asset{.path = path, .name = {}, .content = {}, .bounds = bounds(scan), .is_cloud = scan.is_cloud()};
  asset.content = std::move(scan);
  return asset;
}

inline Asset make_asset(Rbvh&& rbvh, const std::string& path) {
  Asset asset{.path = path,
              .name = {},
              .content = {},
              .bounds = rbvh.source.bounds,
              .is_cloud = rbvh.source.triangles == 0};
  asset.content = std::move(rbvh);
  return asset;
}

}  // namespace rbvh
