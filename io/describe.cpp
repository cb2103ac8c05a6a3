#include "io/describe.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "io/hash.h"
#include "io/parts_file.h"
#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "io/scan_io.h"
#include "io/scene_file.h"
#include "pipeline/measure/measure_json.h"
#include "pipeline/proxy/proxy_surface.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/scene/asset_content.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

template <class Header>
std::string format_version(const Header& header) {
  return std::to_string(header.major) + "." + std::to_string(header.minor);
}

template <class T>
Json vec_json(const Vec3<T>& v) {
  return {v.x, v.y, v.z};
}

template <class T>
Json bounds_json(const Bounds3<T>& b) {
  if (b.empty()) return nullptr;
  return {{"lo", vec_json(b.lo)}, {"hi", vec_json(b.hi)}};
}

/// In the file's coordinates. Where nothing is shifted, floats stay as short as they are.
Json bounds_json(const Bounds3f& b, const Vec3d& shift) {
  if (b.empty() || shift == Vec3d{}) return bounds_json(b);
  return bounds_json(Bounds3d{Vec3d(b.lo) + shift, Vec3d(b.hi) + shift});
}

std::uint64_t primitives_of(const RbvhSource& source) {
  return source.triangles > 0 ? source.triangles : source.vertices;
}

Json streams_json(const StreamBytes& s) {
  return {{"tree", s.tree},     {"leaves", s.leaves}, {"positions", s.positions}, {"normals", s.normals},
          {"colors", s.colors}, {"radii", s.radii},   {"triangles", s.triangles}};
}

/// Surface distances that were measured, the larger of both ways: of the diagonal, and in scan units. Else
/// what build sampled.
Json reached_json(const Level& level, double diagonal) {
  const LevelFidelity& fidelity = level.fidelity;
  if (!fidelity.measured || fidelity.more.views == 0) {
    if (!(level.reached > 0)) return nullptr;
    const auto sampled = static_cast<double>(level.reached);
    return {
        {"error", sampled}, {"error_length", sampled * diagonal}, {"max", nullptr}, {"max_length", nullptr}};
  }
  const LevelMeasures& m = fidelity.more;
  const auto rms = static_cast<double>(std::max(m.to_scan_rms, m.to_level_rms)),
             most = static_cast<double>(std::max(m.to_scan_max, m.to_level_max));
  return {{"error", rms}, {"error_length", rms * diagonal}, {"max", most}, {"max_length", most * diagonal}};
}

Json level_json(const Level& level, const RbvhSource& source) {
  const std::uint64_t primitives = primitives_of(source);
  const auto diagonal = static_cast<double>(source.bounds.diagonal());
  Json json = {{"name", level.name},
               {"rho", float_json(level.rho)},
               {"alpha", float_json(level.alpha)},
               {"phi_degrees", float_json(level.phi_degrees)},
               {"error", float_json(level.error)},
               {"error_length", static_cast<double>(level.error) * diagonal},
               {"reached", reached_json(level, diagonal)},
               {"nodes", level.nodes.size()},
               {"leaves", level.leaves.size()},
               {"primitive_leaves", level.primitive_leaves.size()},
               {"primitives", primitive_count(level)},
               {"atlas", {level.atlas_width, level.atlas_height}},
               {"texels_used", level.texels_used},
               {"bytes", level.stored_bytes},
               {"streams", streams_json(level.streams)},
               {"bytes_per_primitive", primitives == 0 ? Json(nullptr)
                                                       : Json(static_cast<double>(level.stored_bytes) /
                                                              static_cast<double>(primitives))},
               {"bounds", bounds_json(level.bounds, source.shift)},
               {"layers", Json::array()},
               {"fidelity", nullptr}};
  for (const Layer& layer : level.layers) {
    const auto [width, height] = atlas_size(level, layer);
    json["layers"].push_back({{"name", layer.name},
                              {"channels", layer.channels},
                              {"atlas", {width, height}},
                              {"lo", float_json(layer.lo)},
                              {"hi", float_json(layer.hi)},
                              {"bytes", layer.stored_bytes}});
  }
  json["derived_from"] = level.derived_from.empty() ? Json(nullptr) : Json(level.derived_from);
  json["fidelity"] = fidelity_json(level.fidelity);
  return json;
}

Json source_json(const RbvhSource& source) {
  return {{"name", source.name},
          {"hash", hash_digits(source.hash)},
          {"kind", source.triangles > 0 ? "mesh" : "cloud"},
          {"vertices", source.vertices},
          {"triangles", source.triangles},
          {"area", source.area},
          {"units", source.units},
          {"shift", vec_json(source.shift)},
          {"bounds", bounds_json(source.bounds, source.shift)},
          {"diagonal", static_cast<double>(source.bounds.diagonal())}};
}

Json pair_json(const std::string& path, const LoadConfig& config) {
  PairHeader header;
  const Rbvh rbvh = load_pair(path, config.memory, &header);
  const RbvhSource& source = rbvh.source;
  Json json = {
      {"file", path},
      {"kind", "rbvh"},
      {"format", format_version(header)},
      {"bytes", header.hierarchy_bytes + header.atlas_bytes},
      {"hierarchy", {{"bytes", header.hierarchy_bytes}, {"hash", hash_digits(header.hierarchy_hash)}}},
      {"atlas",
       {{"file", header.atlas_file},
        {"bytes", header.atlas_bytes},
        {"hash", hash_digits(header.atlas_hash)}}},
      {"source", source_json(source)},
      {"build_options", Json::parse(rbvh.build_options)},
      {"levels", Json::array()}};
  for (const Level& level : rbvh.levels) json["levels"].push_back(level_json(level, source));
  return json;
}

Json proxy_json(const std::string& path) {
  ProxyHeader header;
  const Proxy proxy = load_proxy(path, &header);
  Bounds3f base;
  for (const Vec3f& p : proxy.positions) base.add(p);
  std::uint64_t texels = 0;
  float longest = 0;
  std::map<std::uint32_t, std::uint64_t> sides;
  for (const PatchTile& tile : proxy.tiles) {
    texels += std::uint64_t{tile.side} * tile.side;
    longest = std::max(longest, tile.longest_displacement);
    ++sides[tile.side];
  }
  Json json = {{"file", path},
               {"kind", "proxy"},
               {"format", format_version(header)},
               {"bytes", header.bytes()},
               {"mesh", {{"bytes", header.mesh_bytes}, {"hash", hash_digits(header.mesh_hash)}}},
               {"map",
                {{"file", header.map_file},
                 {"bytes", header.map_bytes},
                 {"hash", hash_digits(header.map_hash)},
                 {"size", {proxy.map_width, proxy.map_height}}}},
               {"source",
                {{"name", header.source.name},
                 {"hash", hash_digits(header.source.hash)},
                 {"shift", vec_json(header.source.shift)}}},
               {"vertices", proxy.positions.size()},
               {"patches", proxy.quads.size()},
               {"texels", texels},
               {"longest_displacement", float_json(longest)},
               {"base_bounds", bounds_json(base, header.source.shift)},
               {"bounds", bounds_json(surface_bounds(proxy), header.source.shift)},
               {"tiles", Json::array()}};
  for (const auto& [side, patches] : sides) json["tiles"].push_back({{"side", side}, {"patches", patches}});
  return json;
}

std::uint64_t bytes_of(const std::string& path) {
  std::error_code code;
  const std::uintmax_t bytes = std::filesystem::file_size(path, code);
  return code ? 0 : bytes;
}

/// With the files that belong to it.
std::uint64_t object_bytes(const SceneObject& object, const std::string& path) {
  std::uint64_t bytes = bytes_of(path);
  if (object.level() != nullptr) bytes += bytes_of(atlas_path(path));
  if (object.proxy() != nullptr) bytes += bytes_of(proxy_map_path(path)) + bytes_of(proxy_sidecar_path(path));
  return bytes;
}

Json scene_json(const std::string& path, const LoadConfig& config) {
  const Asset asset = load_asset(path, config);
  const Scene& scene = *asset.scene();
  const SceneFile file = read_scene(path);
  std::vector<std::uint64_t> placed(scene.objects.size(), 0);
  for (const SceneInstance& instance : scene.instances) ++placed[instance.object];
  std::uint64_t leaves = 0, bytes = bytes_of(path);
  Json objects = Json::array();
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const SceneObject& object = scene.objects[i];
    const std::uint64_t own_bytes = object_bytes(object, file.objects[i].path);
    leaves += placed[i] * leaf_count(object);
    bytes += own_bytes;
    objects.push_back({{"name", object.name},
                       {"file", file.objects[i].path},
                       {"kind", object.proxy()              ? "proxy"
                                : object.level()            ? "rbvh"
                                : object.scan()->is_cloud() ? "cloud"
                                                            : "mesh"},
                       {"level", object.level() ? Json(object.level()->name) : Json(nullptr)},
                       {"leaves", leaf_count(object)},
                       {"bytes", own_bytes},
                       {"instances", placed[i]},
                       {"bounds", bounds_json(object.bounds, object.shift)}});
  }
  return {{"file", path},
          {"kind", "scene"},
          {"bytes", bytes},
          {"up", scene.z_is_up ? "+Z" : "+Y"},
          {"instances", scene.instances.size()},
          {"leaves", leaves},
          {"bounds", bounds_json(asset.bounds, scene.shift)},
          {"shift", vec_json(scene.shift)},
          {"objects", std::move(objects)}};
}

Json parts_json(const PartsTable& table, const std::string& path) {
  const auto diagonal = static_cast<double>(table.source.bounds.diagonal());
  std::uint64_t bytes = bytes_of(path);
  Json parts = Json::array(), levels = Json::array();
  for (const PairPart& part : table.parts) {
    bytes += part.bytes;
    parts.push_back({{"file", part_path(path, part)},
                     {"bytes", part.bytes},
                     {"vertices", part.vertices},
                     {"triangles", part.triangles},
                     {"bounds", bounds_json(part.levels.front().bounds, table.source.shift)}});
  }
  for (std::size_t i = 0; i < table.levels.size(); ++i) {
    const PartsTable::Level& level = table.levels[i];
    std::uint64_t leaves = 0, level_bytes = 0;
    for (const PairPart& part : table.parts) {
      leaves += part.levels[i].leaves;
      level_bytes += part.levels[i].bytes;
    }
    levels.push_back({{"name", level.name},
                      {"rho", float_json(level.rho)},
                      {"error", float_json(level.error)},
                      {"error_length", static_cast<double>(level.error) * diagonal},
                      {"reached", float_json(level.reached)},
                      {"leaves", leaves},
                      {"bytes", level_bytes}});
  }
  return {{"file", path},
          {"kind", "parts"},
          {"bytes", bytes},
          {"source", source_json(table.source)},
          {"build_options", Json::parse(table.build_options)},
          {"levels", std::move(levels)},
          {"parts", std::move(parts)}};
}

Json scan_json(const std::string& path, const LoadConfig& config) {
  check_read_budget(config.memory, path);
  RawScan scan = read_scan(path, {}, config.memory);
  scan.notes.insert(scan.notes.end(), scan.texture_faults.begin(), scan.texture_faults.end());
  const bool is_mesh = !scan.triangles.empty();
  Bounds3d box;
  std::uint64_t non_finite = 0;
  for (const Vec3d& p : scan.positions) {
    if (is_finite(p))
      box.add(p + scan.shift);
    else
      ++non_finite;
  }
  Json json = {{"file", path},
               {"kind", is_mesh ? "mesh" : "cloud"},
               {"vertices", scan.positions.size()},
               {"triangles", scan.triangles.size()},
               {"objects", std::set<std::int32_t>(scan.object_ids.begin(), scan.object_ids.end()).size()},
               {"non_finite", non_finite},
               {"bounds", bounds_json(box)},
               {"shift", vec_json(scan.shift)},
               {"units", scan.units.empty() ? "unknown" : scan.units},
               {"normals", !scan.normals.empty()},
               {"radii", !scan.radii.empty()},
               {"colors", !scan.colors.empty()},
               {"textures", Json::array()},
               {"properties", Json::array()},
               {"notes", scan.notes}};
  if (scan.object_ids.empty()) json["objects"] = 1;
  for (const ScalarProperty& property : scan.properties) json["properties"].push_back(property.name);
  for (const Texture& texture : scan.textures)
    json["textures"].push_back(
        {{"image", texture.image->name}, {"width", texture.image->width}, {"height", texture.image->height}});
  if (is_mesh) {
    double area = 0;
    for (const Triangle& t : scan.triangles) {
      const Vec3d a = scan.positions[t[0]];
      const double twice = length(cross(scan.positions[t[1]] - a, scan.positions[t[2]] - a));
      if (std::isfinite(twice)) area += twice / 2;
    }
    json["area"] = area;
  }
  return json;
}

}  // namespace

Json describe(const std::string& path, const LoadConfig& config) {
  if (is_parts(path)) return parts_json(read_parts(path), path);
  if (is_rbvh(path)) return pair_json(path, config);
  if (is_proxy(path)) return proxy_json(path);
  if (is_scene(path)) return scene_json(path, config);
  return scan_json(path, config);
}

std::string describe_json(const std::string& path, const LoadConfig& config) {
  return describe(path, config).dump(2, ' ', false, Json::error_handler_t::replace);
}

}  // namespace rbvh
