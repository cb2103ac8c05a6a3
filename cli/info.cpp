// rbvh info: what a pair, a proxy, a scan or a scene holds.
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "cli/common.h"
#include "cli/measure.h"
#include "cli/stages.h"
#include "cli/subject.h"
#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "io/scan_io.h"
#include "io/scene_file.h"
#include "pipeline/proxy/proxy_surface.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

// Names out of a file go to a terminal only without its control characters.
std::string printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return text;
}

std::string hex(std::uint64_t hash) { return fmt::format("{:016x}", hash); }

// The shortest decimal that is this float: 0.85, not 0.8500000238418579.
Json float_json(float value) { return Json::parse(fmt::format("{}", value), nullptr, false); }

template <class T>
Json vec_json(const Vec3<T>& v) {
  return {v.x, v.y, v.z};
}

template <class T>
Json bounds_json(const Bounds3<T>& b) {
  if (b.empty()) return nullptr;
  return {{"lo", vec_json(b.lo)}, {"hi", vec_json(b.hi)}};
}

std::string vec_text(const Json& v) {
  return fmt::format("{:.9g} {:.9g} {:.9g}", v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
}

std::string bounds_text(const Json& b) {
  return b.is_null() ? "none" : vec_text(b["lo"]) + " to " + vec_text(b["hi"]);
}

// "1 level": of the JSON's own "levels".
std::string count(const Json& json, const std::string& noun) {
  return counted(json[plural(noun)].get<std::uint64_t>(), noun);
}

// --- pairs
// --------------------------------------------------------------------------------------------------------

std::uint64_t primitives_of(const RbvhSource& source) {
  return source.triangles > 0 ? source.triangles : source.vertices;
}

Json level_json(const Level& level, std::uint64_t primitives) {
  Json json = {{"name", level.name},
               {"rho", float_json(level.rho)},
               {"alpha", float_json(level.alpha)},
               {"phi_degrees", float_json(level.phi_degrees)},
               {"nodes", level.nodes.size()},
               {"leaves", level.leaves.size()},
               {"exact_leaves", level.exact_leaves.size()},
               {"exact_primitives", level.exact_primitives.size()},
               {"atlas", {level.atlas_width, level.atlas_height}},
               {"texels_used", level.texels_used},
               {"bytes", level.stored_bytes},
               {"bytes_per_primitive", primitives == 0 ? Json(nullptr)
                                                       : Json(static_cast<double>(level.stored_bytes) /
                                                              static_cast<double>(primitives))},
               {"bounds", bounds_json(level.bounds)},
               {"layers", Json::array()},
               {"fidelity", nullptr}};
  for (const Layer& layer : level.layers) {
    const auto [width, height] = atlas_size(level, layer);
    json["layers"].push_back({{"name", layer.name},
                              {"channels", layer.channels},
                              {"atlas", {width, height}},
                              {"lo", float_json(layer.lo)},
                              {"hi", float_json(layer.hi)}});
  }
  json["derived_from"] = level.derived_from.empty() ? Json(nullptr) : Json(level.derived_from);
  json["fidelity"] = fidelity_json(level.fidelity);
  return json;
}

Json pair_json(const Context& context, const std::string& path) {
  PairHeader header;
  const Rbvh rbvh = load_pair(context, path, &header);
  const RbvhSource& source = rbvh.source;
  Json json = {
      {"file", path},
      {"kind", "rbvh"},
      {"format", fmt::format("{}.{}", header.major, header.minor)},
      {"bytes", header.hierarchy_bytes + header.atlas_bytes},
      {"hierarchy", {{"bytes", header.hierarchy_bytes}, {"hash", hex(header.hierarchy_hash)}}},
      {"atlas",
       {{"file", atlas_path(path)}, {"bytes", header.atlas_bytes}, {"hash", hex(header.atlas_hash)}}},
      {"source",
       {{"name", source.name},
        {"hash", hex(source.hash)},
        {"kind", source.triangles > 0 ? "mesh" : "cloud"},
        {"vertices", source.vertices},
        {"triangles", source.triangles},
        {"area", source.area},
        {"units", source.units},
        {"shift", vec_json(source.shift)},
        {"bounds", bounds_json(source.bounds)}}},
      {"build_options", Json::parse(rbvh.build_options)},
      {"levels", Json::array()}};
  for (const Level& level : rbvh.levels) json["levels"].push_back(level_json(level, primitives_of(source)));
  return json;
}

std::string pair_text(const Json& json) {
  const Json& source = json["source"];
  const auto string = [](const Json& value) { return printable(value.get<std::string>()); };
  const auto bytes = [](const Json& value) { return format_bytes(value.get<std::uint64_t>()); };
  std::string text = string(json["file"]) + ": RBVH pair, format " + string(json["format"]) + ", " +
                     bytes(json["bytes"]) + " (hierarchy " + bytes(json["hierarchy"]["bytes"]) + ", atlas " +
                     bytes(json["atlas"]["bytes"]) + ")\n";
  text += "source   " + string(source["name"]) + " (" + string(source["hash"]) +
          "): " + string(source["kind"]) + ", " + count(source, "vertex") + ", " + count(source, "triangle") +
          ", area " + fmt::format("{:.6g}", source["area"].get<double>()) + ", units " +
          string(source["units"]) + "\n";
  text += "bounds   " + bounds_text(source["bounds"]) + "\n";
  text += "shift    " + vec_text(source["shift"]) + "\n";
  text += "options  " + printable(json["build_options"].dump()) + "\n";
  text +=
      "level       rho  alpha  phi   leaves    exact    nodes        atlas  used      bytes  per primitive  "
      "layers\n";
  for (const Json& level : json["levels"]) {
    const auto width = level["atlas"][0].get<std::uint64_t>(),
               height = level["atlas"][1].get<std::uint64_t>();
    std::string layers;
    for (const Json& layer : level["layers"])
      layers.append(layers.empty() ? "" : " ").append(string(layer["name"]));
    const Json& each = level["bytes_per_primitive"];
    text += fmt::format(
        "{:<6} {:>8.6g}  {:>5.3g}  {:>3.3g} {:>8} {:>8} {:>8} {:>12}  {:>3.0f}% {:>10} {:>14}  {}\n",
        string(level["name"]), level["rho"].get<double>(), level["alpha"].get<double>(),
        level["phi_degrees"].get<double>(), level["leaves"].dump(), level["exact_leaves"].dump(),
        level["nodes"].dump(), fmt::format("{} x {}", width, height),
        100 * level["texels_used"].get<double>() / static_cast<double>(width * height), bytes(level["bytes"]),
        each.is_null() ? "-" : fmt::format("{:.3g} B", each.get<double>()), layers);
  }
  for (const Json& level : json["levels"])
    if (!level["derived_from"].is_null())
      text += string(level["name"]) + " is derived from " + string(level["derived_from"]) + "\n";
  for (const Json& level : json["levels"]) {
    const Json& f = level["fidelity"];
    if (f.is_null()) continue;
    const auto figure = [&](const char* pointer) { return f.at(Json::json_pointer(pointer)).get<double>(); };
    text += string(level["name"]) + " against its source: mask mismatch " +
            fmt::format("{:.3g}%, |dt| median {:.2g}, p99 {:.2g} of the diagonal; worst view: {}, {}, {}\n",
                        figure("/mask_mismatch_percent"), figure("/median_dt"), figure("/p99_dt"),
                        count(f, "hole"), count(f, "leak"), count(f, "wall"));
    if (f.contains("image"))
      text += fmt::format(
          "   surface distance {:.2g}% rms, {:.2g}% at most; normals {:.2g} degrees (p95 {:.2g}); image RMSE "
          "{:.3g}, {} of the control's; {} of {} x {}\n",
          std::max(figure("/level_to_scan/rms_percent"), figure("/scan_to_level/rms_percent")),
          std::max(figure("/level_to_scan/max_percent"), figure("/scan_to_level/max_percent")),
          figure("/normal_degrees/median"), figure("/normal_degrees/p95"), figure("/image/rmse"),
          f["image_relative"].is_null() ? "-" : fmt::format("{:.2f}", figure("/image_relative")),
          count(f, "view"), f["resolution"].dump(), f["resolution"].dump());
  }
  return text;
}

// --- proxies
// ------------------------------------------------------------------------------------------------------

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
               {"format", fmt::format("{}.{}", header.major, header.minor)},
               {"bytes", header.bytes()},
               {"mesh", {{"bytes", header.mesh_bytes}, {"hash", hex(header.mesh_hash)}}},
               {"map",
                {{"file", proxy_map_path(path)},
                 {"bytes", header.map_bytes},
                 {"hash", hex(header.map_hash)},
                 {"size", {proxy.map_width, proxy.map_height}}}},
               {"source",
                {{"name", header.source.name},
                 {"hash", hex(header.source.hash)},
                 {"shift", vec_json(header.source.shift)}}},
               {"vertices", proxy.positions.size()},
               {"patches", proxy.quads.size()},
               {"texels", texels},
               {"longest_displacement", float_json(longest)},
               {"base_bounds", bounds_json(base)},
               {"bounds", bounds_json(surface_bounds(proxy))},
               {"tiles", Json::array()}};
  for (const auto& [side, patches] : sides) json["tiles"].push_back({{"side", side}, {"patches", patches}});
  return json;
}

std::string proxy_text(const Json& json) {
  const auto bytes = [](const Json& value) { return format_bytes(value.get<std::uint64_t>()); };
  const Json &source = json["source"], &map = json["map"];
  std::string text = printable(json["file"].get<std::string>()) + ": proxy, format " +
                     json["format"].get<std::string>() + ", " + bytes(json["bytes"]) + " (mesh " +
                     bytes(json["mesh"]["bytes"]) + ", map " + bytes(map["bytes"]) + ")\n";
  text += "source   " + printable(source["name"].get<std::string>()) + " (" +
          source["hash"].get<std::string>() + ")\n";
  text += "base     " + count(json, "patch") + ", " + count(json, "vertex") + ", " +
          bounds_text(json["base_bounds"]) + "\n";
  text += "surface  " + bounds_text(json["bounds"]) + ", displaced by up to " +
          fmt::format("{:.6g}", json["longest_displacement"].get<double>()) + "\n";
  text += "shift    " + vec_text(source["shift"]) + "\n";
  text += fmt::format("map      {} x {}, {} texels in tiles of", map["size"][0].dump(), map["size"][1].dump(),
                      json["texels"].dump());
  for (const Json& tile : json["tiles"])
    text += fmt::format(" {} x {} ({})", tile["side"].dump(), tile["side"].dump(), tile["patches"].dump());
  return text + "\n";
}

// --- scenes
// -------------------------------------------------------------------------------------------------------

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

Json scene_json(Context& context, const std::string& path) {
  const Subject subject = load_subject(context, path);
  const Scene& scene = *subject.scene();
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
                       {"bounds", bounds_json(object.bounds)}});
  }
  return {{"file", path},
          {"kind", "scene"},
          {"bytes", bytes},
          {"up", scene.z_is_up ? "+Z" : "+Y"},
          {"instances", scene.instances.size()},
          {"leaves", leaves},
          {"bounds", bounds_json(subject.bounds)},
          {"objects", std::move(objects)}};
}

std::string scene_text(const Json& json) {
  const auto string = [](const Json& value) { return printable(value.get<std::string>()); };
  const auto bytes = [](const Json& value) { return format_bytes(value.get<std::uint64_t>()); };
  std::string text = string(json["file"]) + ": scene, " +
                     counted(json["instances"].get<std::uint64_t>(), "instance") + ", " +
                     counted(json["leaves"].get<std::uint64_t>(), "leaf") + ", " + bytes(json["bytes"]) +
                     " with all its files\n";
  text += "bounds   " + bounds_text(json["bounds"]) + ", up " + string(json["up"]) + "\n";
  for (const Json& object : json["objects"])
    text += fmt::format("{:<8} {} {}, {}, {}, placed {}\n", string(object["name"]), string(object["file"]),
                        object["level"].is_null() ? string(object["kind"]) : string(object["level"]),
                        counted(object["leaves"].get<std::uint64_t>(), "leaf"), bytes(object["bytes"]),
                        counted(object["instances"].get<std::uint64_t>(), "time"));
  return text;
}

// --- scans
// --------------------------------------------------------------------------------------------------------

Json scan_json(const Context& context, const std::string& path) {
  check_read_budget(context, path);
  const RawScan scan = read_scan(path);
  const bool is_mesh = !scan.triangles.empty();
  Bounds3d box;
  std::uint64_t non_finite = 0;
  for (const Vec3d& p : scan.positions) {
    if (is_finite(p))
      box.add(p);
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
               {"normals", !scan.normals.empty()},
               {"radii", !scan.radii.empty()},
               {"colors", !scan.colors.empty()},
               {"properties", Json::array()},
               {"notes", scan.notes}};
  if (scan.object_ids.empty()) json["objects"] = 1;
  for (const ScalarProperty& property : scan.properties) json["properties"].push_back(property.name);
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

std::string scan_text(const Json& json) {
  std::string text = printable(json["file"].get<std::string>()) + ": " + json["kind"].get<std::string>() +
                     ", " + count(json, "vertex") + ", " + count(json, "triangle") + ", " +
                     count(json, "object");
  if (json.contains("area")) text += ", area " + fmt::format("{:.6g}", json["area"].get<double>());
  text += "\n";
  if (json["non_finite"] != 0)
    text += "not finite  " + counted(json["non_finite"].get<std::uint64_t>(), "vertex") + "\n";
  text += "bounds      " + bounds_text(json["bounds"]) + "\n";
  text += "shift       " + vec_text(json["shift"]) + "\n";
  text += "vertices    position";
  for (const char* attribute : {"normals", "radii", "colors"})
    if (json[attribute].get<bool>()) text += std::string(" ") + attribute;
  for (const Json& name : json["properties"]) text += " " + printable(name.get<std::string>());
  text += "\n";
  for (const Json& sentence : json["notes"])
    text += "note        " + printable(sentence.get<std::string>()) + "\n";
  return text;
}

void run_info(Context& context, const std::string& path, bool as_json) {
  const bool is_pair = is_rbvh(path), is_of_quads = is_proxy(path), places = is_scene(path);
  const Json json = is_pair       ? pair_json(context, path)
                    : is_of_quads ? proxy_json(path)
                    : places      ? scene_json(context, path)
                                  : scan_json(context, path);
  print_data(as_json       ? json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"
             : is_pair     ? pair_text(json)
             : is_of_quads ? proxy_text(json)
             : places      ? scene_text(json)
                           : scan_text(json));
}

}  // namespace

void add_info(CLI::App& app, Context& context) {
  struct Options {
    std::string file;
    bool as_json = false;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* stage =
      add_stage(app, context,
                {"info", "Say what a pair, a proxy, a scan or a scene holds", "rbvh info dragon.rbvh --json"},
                0, [&context, options] { run_info(context, options->file, options->as_json); });
  stage->add_option("FILE", options->file, "an .rbvh, a proxy, a scan (-: standard input) or a scene (.json)")
      ->required();
  stage->add_flag("--json", options->as_json, "as JSON");
}

}  // namespace rbvh
