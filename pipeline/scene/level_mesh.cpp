#include "pipeline/rbvh/level_mesh.h"

#include "pipeline/base/error.h"
#include "pipeline/base/units.h"
#include "pipeline/rbvh/lod.h"
#include "pipeline/rbvh/mesh_texture.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/mesh.h"

namespace rbvh {

Scan plain_level_mesh(const Asset& pair, const std::string& name, LevelMeshCounts* counts) {
  const Rbvh* rbvh = pair.rbvh();
  if (rbvh == nullptr) throw Error(ErrorKind::kUsage, pair.path, "is no .rbvh pair, and has no levels");
  const Level* level = rbvh->find_level(name);
  if (level == nullptr)
    throw Error(ErrorKind::kUsage, pair.path,
                "there is no level '" + name + "'; there are " + level_names(*rbvh));
  Scan mesh = level_mesh(*level, pair.is_cloud, counts);
  if (mesh.positions.empty() || mesh.is_cloud() != pair.is_cloud)
    throw Error(ErrorKind::kInput, pair.path, "level " + level->name + " has no surface");
  mesh.shift = rbvh->source.shift;
  if (unit_meters(rbvh->source.units)) mesh.units = rbvh->source.units;
  return mesh;
}

Scan level_mesh(const Asset& pair, const std::string& name, LevelMeshCounts* counts) {
  Scan mesh = plain_level_mesh(pair, name, counts);
  const Level& level = *pair.rbvh()->find_level(name);
  if (const std::vector<std::uint32_t> leaves = textured_leaves(level, mesh); !leaves.empty())
    add_texture(level, leaves, mesh);
  return mesh;
}

}  // namespace rbvh
