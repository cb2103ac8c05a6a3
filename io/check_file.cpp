#include "io/check_file.h"

#include "io/parts_file.h"
#include "io/scan_io.h"
#include "io/scene_file.h"
#include "pipeline/scene/asset_content.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

Json pair_json(const Rbvh& rbvh) {
  std::uint64_t leaves = 0, texels = 0;
  for (const Level& level : rbvh.levels) {
    leaves += level.leaves.size();
    texels += std::uint64_t{level.atlas_width} * level.atlas_height;
  }
  return {{"kind", "rbvh"}, {"levels", rbvh.levels.size()}, {"leaves", leaves}, {"texels", texels}};
}

Json proxy_json(const Proxy& proxy) {
  std::uint64_t texels = 0;
  for (const PatchTile& tile : proxy.tiles) texels += std::uint64_t{tile.side} * tile.side;
  return {{"kind", "proxy"}, {"patches", proxy.quads.size()}, {"texels", texels}};
}

Json scene_json(const Scene& scene) {
  return {{"kind", "scene"},
          {"objects", scene.objects.size()},
          {"instances", scene.instances.size()},
          {"leaves", first_leaves(scene).back()}};
}

Json scan_json(const RawScan& scan) {
  return {{"kind", scan.triangles.empty() ? "cloud" : "mesh"},
          {"vertices", scan.positions.size()},
          {"triangles", scan.triangles.size()}};
}

}  // namespace

CheckedFile check_file(const std::string& path, const LoadConfig& config, const Progress& progress) {
  CheckedFile file;
  file.summary = {{"file", path}, {"valid", true}};
  if (is_parts(path)) {
    file.summary.update(check_parts(path, config.memory, progress));
  } else if (is_rbvh(path)) {
    file.asset = load_asset(path, config, progress);
    file.summary.update(pair_json(*file.asset->rbvh()));
  } else if (is_scene(path)) {
    file.asset = load_asset(path, config, progress);
    file.summary.update(scene_json(*file.asset->scene()));
  } else if (is_proxy(path)) {
    file.proxy = load_proxy(path, &file.proxy_header);
    file.summary.update(proxy_json(*file.proxy));
  } else {
    refuse_proxy(path);
    check_read_budget(config.memory, path);
    file.summary.update(scan_json(read_scan(path)));
  }
  return file;
}

}  // namespace rbvh
