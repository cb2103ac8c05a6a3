#include "rbvh/frame.h"

#include "pipeline/scene/asset_content.h"

namespace rbvh {

Vec3d shift(const Asset& asset) {
  if (const Rbvh* rbvh = asset.rbvh()) return rbvh->source.shift;
  if (const Scan* scan = asset.scan()) return scan->shift;
  if (const Scene* scene = asset.scene()) return scene->shift;
  return {};
}

Bounds3d file_bounds(const Asset& asset) {
  if (asset.bounds.empty()) return {};
  return {Vec3d(asset.bounds.lo) + shift(asset), Vec3d(asset.bounds.hi) + shift(asset)};
}

}  // namespace rbvh
