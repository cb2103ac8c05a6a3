#include "pipeline/trace/make_tracer.h"

#include <algorithm>

#include "pipeline/base/error.h"
#include "pipeline/trace/exact_words.h"
#include "pipeline/trace/trace_footprint.h"

namespace rbvh {
namespace {

constexpr std::uint64_t kBytesPerPatch = 400;
constexpr std::uint64_t kMostNumbers = 1u << 24;

const Level& level_of(const Asset& asset, const std::string& level) {
  const Level* found = asset.rbvh()->find_level(level);
  RBVH_CHECK(found != nullptr);
  return *found;
}

std::uint64_t exact_bytes(std::uint64_t primitives, const ExactConfig& config) {
  return primitives * static_cast<std::uint64_t>(info(config.builder).bytes);
}

}  // namespace

std::unique_ptr<Tracer> make_tracer(const Device& device, const Asset& asset, const std::string& level,
                                    const SceneConfig& config, float spread) {
  if (const Rbvh* rbvh = asset.rbvh()) {
    if (level == "auto")
      return std::make_unique<FootprintTracer>(make_footprint_tracer(device, *rbvh, spread));
    return std::make_unique<TileTracer>(make_tile_tracer(device, level_of(asset, level)));
  }
  if (const Scene* scene = asset.scene())
    return std::make_unique<SceneTracer>(make_scene_tracer(device, *scene, config));
  RBVH_CHECK(asset.scan() != nullptr);
  return std::make_unique<ExactTracer>(make_exact_tracer(device, *asset.scan(), config.exact));
}

std::unique_ptr<Tracer> make_tracer(const Device& device, const Asset& asset, const TracerConfig& config) {
  std::vector<std::string> wanted;
  if (!config.level.empty()) wanted.push_back(config.level);
  SceneConfig scene;
  scene.pixels = config.pixels;
  scene.proxy.cache_bytes = config.patch_cache_bytes;
  std::optional<ExactTraversal> traversal;
  std::optional<ExactBuilder> builder;
  if (!config.traversal.empty()) traversal = parse_exact_traversal(config.traversal);
  if (!config.builder.empty()) builder = parse_exact_builder(config.builder);
  scene.exact = exact_config(traversal, builder);
  return make_tracer(device, asset, choose_levels(asset, wanted, true).front(), scene, config.spread);
}

std::vector<std::string> choose_levels(const Asset& asset, const std::vector<std::string>& wanted,
                                       bool has_auto) {
  if (const Scene* scene = asset.scene(); scene != nullptr && !scene->level.empty()) return {scene->level};
  if (!asset.rbvh()) return {asset.scan() ? "exact" : "scene"};
  if (has_auto && wanted == std::vector<std::string>{"auto"}) return wanted;
  return choose_levels(level_names(asset), wanted, asset.path);
}

std::vector<std::string> choose_levels(const std::vector<std::string>& present,
                                       const std::vector<std::string>& wanted, const std::string& file) {
  if (wanted.empty()) return {present.front()};
  std::vector<std::string> chosen;
  const auto choose = [&](const std::string& name) {
    if (std::find(chosen.begin(), chosen.end(), name) == chosen.end()) chosen.push_back(name);
  };
  for (const std::string& name : wanted) {
    if (name == "all") {
      for (const std::string& each : present) choose(each);
    } else if (std::find(present.begin(), present.end(), name) != present.end()) {
      choose(name);
    } else {
      std::string names;
      for (const std::string& each : present) names += (names.empty() ? "" : ", ") + each;
      throw Error(ErrorKind::kUsage, file, "there is no level '" + name + "'; there are " + names);
    }
  }
  return chosen;
}

void check_tracer_budget(const MemoryBudget& memory, const Asset& asset, const SceneConfig& config) {
  if (const Scan* scan = asset.scan())
    return check_budget(
        memory, exact_bytes(scan->is_cloud() ? scan->positions.size() : scan->triangles.size(), config.exact),
        asset.path, "its hierarchy");
  const Scene* scene = asset.scene();
  if (scene == nullptr) return;
  std::uint64_t bytes = scene->instances.size() * (sizeof(SceneInstance) + sizeof(WideNode));
  bool has_proxy = false;
  for (const SceneObject& object : scene->objects) {
    if (object.scan() != nullptr) {
      bytes += exact_bytes(leaf_count(object), config.exact);
    } else if (const Level* level = object.level()) {
      if (!level->layers.empty()) bytes += level->layers[0].texels.size() * sizeof(std::uint16_t);
    } else if (const Proxy* found = object.proxy()) {
      const Proxy& proxy = *found;
      has_proxy = true;
      bytes += 2 * proxy.map.size() * sizeof(Vec3f) + proxy.quads.size() * kBytesPerPatch;  // here, and there
    }
  }
  if (has_proxy) bytes += config.proxy.cache_bytes;
  check_budget(memory, bytes, asset.path, "casting rays at it");
}

void check_leaf_numbers(const Asset& asset, const std::string& level) {
  std::uint64_t leaves = 0;
  if (const Scan* scan = asset.scan())
    leaves = scan->is_cloud() ? scan->positions.size() : scan->triangles.size();
  else if (const Scene* scene = asset.scene())
    leaves = first_leaves(*scene).back();
  else if (level == "auto")
    for (const Level& each : asset.rbvh()->levels) leaves += each.leaves.size();
  else
    leaves = level_of(asset, level).leaves.size();
  if (leaves > kMostNumbers)
    throw Error(ErrorKind::kInput, asset.path,
                std::to_string(leaves) +
                    " leaves or primitives are more than the 16777216 that a float32 can number");
}

}  // namespace rbvh
