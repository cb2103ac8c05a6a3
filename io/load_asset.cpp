#include "io/load_asset.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/parts_file.h"
#include "io/proxy_file.h"
#include "io/scan_io.h"
#include "io/scene_file.h"
#include "pipeline/base/error.h"
#include "pipeline/proxy/proxy_surface.h"
#include "pipeline/proxy/tessellate.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scan/ingest.h"
#include "pipeline/scene/asset_content.h"
#include "pipeline/trace/make_tracer.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

// A scan is in memory as the file's bytes, as doubles and as floats.
constexpr std::uint64_t kScanBytesPerFileByte = 3;
// A hierarchy is checked, unpacked and laid out for the device.
constexpr std::uint64_t kPairBytesPerFileByte = 4;
// A map is in memory as it was read and on the device; compressed to half on disk.
constexpr std::uint64_t kProxyBytesPerFileByte = 5;
constexpr std::uint64_t kBytesPerTessellatedTriangle = 120;  // mesh, hierarchy and what builds it

std::uint64_t file_bytes(const std::string& path) {
  std::error_code code;
  const std::uintmax_t size = fs::file_size(path, code);
  return code ? 0 : size;
}

std::uint64_t bytes_to_read(const std::string& path) {
  if (is_rbvh(path)) return file_bytes(path) * kPairBytesPerFileByte + file_bytes(atlas_path(path));
  if (is_proxy(path)) return (file_bytes(path) + file_bytes(proxy_map_path(path))) * kProxyBytesPerFileByte;
  return file_bytes(path) * kScanBytesPerFileByte;
}

/// What config.levels leaves of a pair.
LevelFilter wanted_levels(const std::string& path, const LoadConfig& config) {
  if (!config.levels || config.levels == std::vector<std::string>{"auto"}) return {};
  return [&](const std::vector<std::string>& names) { return choose_levels(names, *config.levels, path); };
}

/// A proxy or, where it is to be tessellated, a scan.
SceneObject load_proxy_object(const std::string& path, const LoadConfig& config) {
  check_budget(config.memory, bytes_to_read(path), path, "reading it");
  SceneObject object;
  ProxyHeader header;
  Proxy proxy = load_proxy(path, &header);
  object.bounds = surface_bounds(proxy);
  object.shift = header.source.shift;
  if (!config.tessellate) {
    object.content = std::move(proxy);
    return object;
  }
  std::uint64_t triangles = 0;
  for (const std::uint32_t level : uniform_levels(proxy, *config.tessellate))
    triangles += std::uint64_t{2} << 2 * level;
  check_budget(config.memory, triangles * kBytesPerTessellatedTriangle, path, "tessellating it");
  Scan scan = tessellate(proxy, *config.tessellate);
  scan.shift = object.shift;
  object.content = std::move(scan);
  return object;
}

SceneObject load_object(const SceneFile::Object& file, const LoadConfig& config, const Progress& progress) {
  const bool is_pair = is_rbvh(file.path);
  if (!file.level.empty() && !is_pair)
    throw Error(ErrorKind::kInput, file.path, "a level is named, and this is no pair");
  SceneObject object;
  if (is_pair) {
    const LevelFilter choose = [&](const std::vector<std::string>& names) {
      if (file.level.empty()) return std::vector{names.front()};
      if (std::find(names.begin(), names.end(), file.level) == names.end())
        throw Error(ErrorKind::kInput, file.path, "there is no level '" + file.level + "'");
      return std::vector{file.level};
    };
    Rbvh rbvh = load_pair(file.path, config.memory, nullptr, choose);
    object.bounds = rbvh.source.bounds;
    object.shift = rbvh.source.shift;
    object.content = std::move(rbvh.levels.front());
  } else if (is_proxy(file.path)) {
    object = load_proxy_object(file.path, config);
  } else {
    Scan scan = load_scan(file.path, config.memory, progress);
    object.bounds = bounds(scan);
    object.shift = scan.shift;
    object.content = std::move(scan);
  }
  object.name = file.name;
  return object;
}

Scene load_scene(const std::string& path, const LoadConfig& config, const Progress& progress) {
  const SceneFile file = read_scene(path);
  std::uint64_t bytes = 0;
  for (const SceneFile::Object& object : file.objects) bytes += bytes_to_read(object.path);
  check_budget(config.memory, bytes, path, "reading all its files");
  Scene scene;
  scene.z_is_up = file.z_is_up;
  for (const SceneFile::Object& object : file.objects) {
    try {
      scene.objects.push_back(load_object(object, config, progress));
    } catch (const Error& error) {
      throw Error(error.kind(), error.file(), error.place(),
                  error.message() + " (object \"" + object.name + "\" of " + path + ")", error.remedy());
    }
  }
  for (const SceneFile::Instance& instance : file.instances)
    scene.instances.push_back({static_cast<std::uint32_t>(instance.object), instance.to_world});
  choose_frame(scene);
  return scene;
}

}  // namespace

bool is_rbvh(const std::string& path) {
  if (path == "-") return false;
  if (fs::path(path).extension() == ".rbvh") return true;
  std::error_code code;
  if (!fs::is_regular_file(path, code)) return false;  // a pipe's first bytes could not be put back
  char start[8] = {};
  std::ifstream(path, std::ios::binary).read(start, sizeof start);
  return std::memcmp(start + 4, "RBVH", 4) == 0;  // where FlatBuffers keep their file identifier
}

Rbvh load_pair(const std::string& path, const MemoryBudget& memory, PairHeader* header,
               const LevelFilter& choose) {
  const std::uint64_t read = bytes_to_read(path);
  check_budget(memory, read, path, "reading it");
  const auto check = [&](const Rbvh& rbvh) {
    std::uint64_t texels = 0;  // bytes of them; the heights are on the device, too
    for (const Level& level : rbvh.levels) {
      texels += std::uint64_t{level.atlas_width} * level.atlas_height * sizeof(std::uint16_t);
      for (const Layer& layer : level.layers) {
        const auto [width, height] = atlas_size(level, layer);
        texels += std::uint64_t{width} * height * layer.channels * sizeof(std::uint16_t);
      }
    }
    check_budget(memory, read + texels, path, "reading it");
  };
  return read_rbvh(path, header, check, choose);
}

Scan load_scan(const std::string& path, const MemoryBudget& memory, const Progress& progress) {
  refuse_proxy(path);
  check_budget(memory, file_bytes(path) * kScanBytesPerFileByte, path, "reading it");
  Scan scan = shift_to_float(read_scan(path, {}, memory));
  check_usable(scan, path);
  if (scan.is_cloud()) complete_cloud(scan, {}, progress);
  return scan;
}

namespace {

Asset load_proxy_asset(const std::string& path, const LoadConfig& config) {
  SceneObject object = load_proxy_object(path, config);
  if (object.scan() != nullptr) {
    Asset asset = make_asset(std::move(std::get<Scan>(object.content)));
    asset.bounds = object.bounds;
    return asset;
  }
  Scene scene;
  scene.shift = object.shift;
  scene.objects.push_back(std::move(object));
  scene.instances.push_back({});
  return make_asset(std::move(scene));
}

}  // namespace

std::optional<Asset> load_coarsest(const Asset& asset, const MemoryBudget& memory) {
  if (asset.scene() == nullptr || asset.scene()->level.empty()) return std::nullopt;
  LoadConfig config{.memory = memory};
  config.levels = std::vector{read_parts(asset.path).levels.back().name};
  return load_asset(asset.path, config);
}

Asset load_asset(const std::string& path, const LoadConfig& config, const Progress& progress) {
  Asset asset = is_parts(path) ? load_parts(path, config)
                : is_rbvh(path)
                    ? make_asset(load_pair(path, config.memory, nullptr, wanted_levels(path, config)))
                : is_scene(path)                ? make_asset(load_scene(path, config, progress))
                : path != "-" && is_proxy(path) ? load_proxy_asset(path, config)
                                                : make_asset(load_scan(path, config.memory, progress));
  asset.path = path;
  asset.name = path == "-" ? "stdin" : fs::path(path).stem().string();
  return asset;
}

Asset load_reference(const std::string& path, const Rbvh& pair, const MemoryBudget& memory,
                     const Progress& progress) {
  Scan scan = load_scan(path, memory, progress);
  move_to_shift(scan, pair.source.shift);
  Asset reference = make_asset(std::move(scan));
  reference.path = path;
  return reference;
}

void save_pair(const std::string& path, const Asset& pair, bool overwrite) {
  if (pair.rbvh() == nullptr)
    throw Error(ErrorKind::kUsage, path, "only pairs are saved so, and this is none");
  write_rbvh(path, *pair.rbvh(), overwrite);
}

}  // namespace rbvh
