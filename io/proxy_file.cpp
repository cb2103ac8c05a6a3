// The three files of a proxy, written and read. The sidecar names the other two by length and hash, so files
// of different proxies are never taken for one.
#include "io/proxy_file.h"

#include <spdlog/fmt/fmt.h>

#include <charconv>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/file_set.h"
#include "io/hash.h"
#include "io/input_file.h"
#include "io/output_file.h"
#include "io/polygon_obj.h"
#include "io/posix_file.h"
#include "io/vdm_image.h"
#include "pipeline/base/error.h"
#include "pipeline/proxy/check_proxy.h"
#include "pipeline/proxy/patch_point.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kFormatName = "rbvh proxy";
constexpr std::uint64_t kMaxMeshBytes = std::uint64_t{1} << 34;  ///< of an OBJ that is parsed
constexpr const char* kRebake = "; bake the proxy again";

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::kInput, path, what + kRebake);
}

// --- writing
// ------------------------------------------------------------------------------------------------------

// The shortest decimal that is this float, also to readers that go by way of a double.
void append_number(std::string& text, float value) {
  char buffer[32];
  const char* end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  double again = 0;
  std::from_chars(buffer, end, again);
  if (static_cast<float>(again) != value)
    end = std::to_chars(buffer, buffer + sizeof buffer, static_cast<double>(value)).ptr;
  text.append(buffer, static_cast<std::size_t>(end - buffer));
}

void append_line(std::string& text, const char* key, std::initializer_list<float> numbers) {
  text += key;
  for (const float number : numbers) {
    text += ' ';
    append_number(text, number);
  }
  text += '\n';
}

// Row 0 of the map is on top, v = 0 at the bottom.
Uv texel_centre(const Proxy& proxy, const PatchTile& tile, std::uint32_t i, std::uint32_t j) {
  return {(tile.x + i + 0.5) / proxy.map_width, 1 - (tile.y + j + 0.5) / proxy.map_height};
}

std::string encode_mesh(const Proxy& proxy) {
  std::string text = "# rbvh proxy: quads over a vector displacement map (.vdm.exr and .vdm.json beside)\n";
  for (const Vec3f& p : proxy.positions) append_line(text, "v", {p.x, p.y, p.z});
  for (const PatchTile& tile : proxy.tiles)
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const TexelPlace place = edge_texel(tile.side, corner, 0);
      const Uv uv = texel_centre(proxy, tile, place.i, place.j);
      append_line(text, "vt", {static_cast<float>(uv.u), static_cast<float>(uv.v)});
    }
  for (std::size_t patch = 0; patch < proxy.quads.size(); ++patch) {
    text += 'f';
    for (std::size_t corner = 0; corner < 4; ++corner)
      text += fmt::format(" {}/{}", proxy.quads[patch][corner] + 1, 4 * patch + corner + 1);
    text += '\n';
  }
  return text;
}

// Json would print a float's digits as a double's.
std::string number_text(float value) {
  std::string text;
  append_number(text, value);
  return text;
}

std::string encode_sidecar(const Proxy& proxy, const ProxyHeader& header) {
  Json json;
  json["format"] = kFormatName;
  json["version"] = {header.major, header.minor};
  json["mesh"] = {{"bytes", header.mesh_bytes}, {"hash", hash_digits(header.mesh_hash)}};
  json["map"] = {{"bytes", header.map_bytes}, {"hash", hash_digits(header.map_hash)},
                 {"width", proxy.map_width},  {"height", proxy.map_height},
                 {"channels", "RGB"},         {"type", "float32"}};
  json["space"] = "object";
  json["order"] = "xyz";
  json["scale"] = 1;
  json["midlevel"] = 0;
  const ProxySource& source = header.source;
  json["source"] = {{"name", source.name},
                    {"hash", hash_digits(source.hash)},
                    {"shift", {source.shift.x, source.shift.y, source.shift.z}}};
  json["tile_columns"] = {"x", "y", "side", "longest_displacement"};
  std::string text = json.dump(1, ' ', false, Json::error_handler_t::replace);
  text.resize(text.size() - 2);  // "\n}"
  text += ",\n \"tiles\": [";
  for (std::size_t i = 0; i < proxy.tiles.size(); ++i) {
    const PatchTile& tile = proxy.tiles[i];
    text += fmt::format("{}\n  [{}, {}, {}, {}]", i == 0 ? "" : ",", tile.x, tile.y, tile.side,
                        number_text(tile.longest_displacement));
  }
  return text + "\n ]\n}\n";
}

struct ProxyOutputs {
  std::string target;  ///< the OBJ's path with a link followed
  OutputFile sidecar;  ///< the head of the set
  OutputFile mesh, map;

  ProxyOutputs(const std::string& path, bool overwrite)
      : target(follow_link(path)),
        sidecar(proxy_sidecar_path(target), overwrite, OutputFile::Role::kInSet),
        mesh(target, overwrite, OutputFile::Role::kInSet),
        map(proxy_map_path(target), overwrite, OutputFile::Role::kInSet) {
    for (const OutputFile* file : {&sidecar, &mesh, &map})
      if (file->is_special())
        throw Error(ErrorKind::kFailure, file->path(),
                    "is no regular file, and a proxy is three files in a folder; name one there");
  }
};

// --- reading
// ------------------------------------------------------------------------------------------------------

// The sidecar, value by value. Any that is missing or of another kind is an error that names it.
struct Sidecar {
  const std::string& path;
  Json json;

  [[noreturn]] void fail(const std::string& what) const { refuse(path, "is malformed: " + what); }
  const Json& at(const Json& object, const char* key) const {
    const auto found = object.is_object() ? object.find(key) : object.end();
    if (!object.is_object() || found == object.end()) fail(std::string("'") + key + "' is missing");
    return *found;
  }
  std::uint64_t whole(const Json& value, std::uint64_t most, const char* name) const {
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() > most)
      fail(std::string("'") + name + "' is no whole number up to " + std::to_string(most));
    return value.get<std::uint64_t>();
  }
  double real(const Json& value, const char* name) const {
    if (!value.is_number()) fail(std::string("'") + name + "' is no number");
    return value.get<double>();
  }
  std::string text(const Json& value, const char* name) const {
    if (!value.is_string()) fail(std::string("'") + name + "' is no text");
    return value.get<std::string>();
  }
  std::uint64_t hash(const Json& value, const char* name) const {
    const std::string digits = text(value, name);
    std::uint64_t hash = 0;
    const char* end = digits.data() + digits.size();
    const auto [stop, error] = std::from_chars(digits.data(), end, hash, 16);
    if (digits.size() != 16 || stop != end || error != std::errc())
      fail(std::string("'") + name + "' is no hash of 16 digits");
    return hash;
  }
};

// Deep nesting would overflow the parser's destructor; ours has four levels.
Json parse_json(std::string_view text, const std::string& path) {
  bool is_too_deep = false;
  const auto limit = [&](int depth, Json::parse_event_t, Json&) {
    is_too_deep |= depth > 8;
    return depth <= 8;
  };
  Json json = Json::parse(text.begin(), text.end(), limit, false);
  if (json.is_discarded() || is_too_deep || !json.is_object())
    refuse(path, "is malformed or cut: it is no JSON object");
  return json;
}

void read_conventions(const Sidecar& in) {
  // Other conventions are read by import_vdm(), whose proxies have this one.
  const Json& json = in.json;
  if (in.text(in.at(json, "space"), "space") != "object" || in.text(in.at(json, "order"), "order") != "xyz" ||
      in.real(in.at(json, "scale"), "scale") != 1 || in.real(in.at(json, "midlevel"), "midlevel") != 0)
    throw Error(ErrorKind::kInput, in.path,
                "has another space, order, scale or midlevel than object, xyz, 1, 0", Remedy::kImportProxy);
}

ProxyHeader read_header(const Sidecar& in, std::uint64_t sidecar_bytes) {
  const Json& json = in.json;
  ProxyHeader header;
  header.sidecar_bytes = sidecar_bytes;
  if (!json.contains("format") || json["format"] != kFormatName)
    throw Error(ErrorKind::kInput, in.path, "is no sidecar of a proxy: its format is not 'rbvh proxy'");
  const Json& version = in.at(json, "version");
  if (!version.is_array() || version.size() != 2) in.fail("'version' is no pair of numbers");
  header.major = static_cast<std::uint16_t>(in.whole(version[0], UINT16_MAX, "version"));
  header.minor = static_cast<std::uint16_t>(in.whole(version[1], UINT16_MAX, "version"));
  if (header.major != kProxyMajor)
    throw Error(
        ErrorKind::kInput, in.path,
        fmt::format("has version {}.{}, and this program reads version {}; use a newer one, or bake the "
                    "proxy again",
                    header.major, header.minor, kProxyMajor));
  read_conventions(in);
  const Json& mesh = in.at(json, "mesh");
  header.mesh_bytes = in.whole(in.at(mesh, "bytes"), kMaxMeshBytes, "mesh.bytes");
  header.mesh_hash = in.hash(in.at(mesh, "hash"), "mesh.hash");
  const Json& map = in.at(json, "map");
  header.map_bytes = in.whole(in.at(map, "bytes"), UINT64_MAX, "map.bytes");
  header.map_hash = in.hash(in.at(map, "hash"), "map.hash");
  const Json& source = in.at(json, "source");
  header.source.name = in.text(in.at(source, "name"), "source.name");
  header.source.hash = in.hash(in.at(source, "hash"), "source.hash");
  const Json& shift = in.at(source, "shift");
  if (!shift.is_array() || shift.size() != 3) in.fail("'source.shift' is no triple of numbers");
  for (int axis = 0; axis < 3; ++axis)
    header.source.shift[axis] = in.real(shift[static_cast<std::size_t>(axis)], "source.shift");
  return header;
}

std::vector<PatchTile> read_tiles(const Sidecar& in) {
  const Json& rows = in.at(in.json, "tiles");
  if (!rows.is_array()) in.fail("'tiles' is no list");
  std::vector<PatchTile> tiles;
  tiles.reserve(rows.size());  // bounded by the sidecar's bytes
  for (const Json& row : rows) {
    if (!row.is_array() || row.size() < 4) in.fail("a tile has fewer than four numbers");
    PatchTile tile;
    tile.x = static_cast<std::uint32_t>(in.whole(row[0], kMaxMapSide, "x"));
    tile.y = static_cast<std::uint32_t>(in.whole(row[1], kMaxMapSide, "y"));
    tile.side = static_cast<std::uint32_t>(in.whole(row[2], kMaxPatchSide, "side"));
    tile.longest_displacement = static_cast<float>(in.real(row[3], "longest_displacement"));
    tiles.push_back(tile);
  }
  return tiles;
}

[[noreturn]] void refuse_without(const std::string& path, const std::string& needed) {
  throw Error(ErrorKind::kInput, path, "comes without " + needed + ": a proxy is three files; bring all");
}

[[noreturn]] void refuse_other(const std::string& path, const std::string& sidecar) {
  refuse(path, "belongs to another proxy than " + sidecar +
                   ", or was changed: it does not have the length and the hash named there");
}

void check_same(std::string_view bytes, std::uint64_t size, std::uint64_t hash, const std::string& path,
                const std::string& sidecar) {
  if (bytes.size() != size || hash_bytes(bytes) != hash) refuse_other(path, sidecar);
}

void read_mesh(std::string_view bytes, const std::string& path, Proxy& proxy) {
  const PolygonMesh mesh = read_polygon_obj(bytes, path);
  if (mesh.face_count() != proxy.tiles.size())
    refuse(path, "has " + std::to_string(mesh.face_count()) + " faces, and its sidecar " +
                     std::to_string(proxy.tiles.size()) + " tiles");
  proxy.positions.reserve(mesh.positions.size());
  for (const Vec3d& p : mesh.positions) proxy.positions.push_back(Vec3f(p));
  proxy.quads.resize(mesh.face_count());
  for (std::size_t face = 0; face < mesh.face_count(); ++face) {
    const std::uint32_t begin = mesh.face_begin(face);
    if (mesh.face_ends[face] - begin != 4) refuse(path, "face " + std::to_string(face + 1) + " is no quad");
    for (std::uint32_t k = 0; k < 4; ++k) {
      const PolygonCorner& corner = mesh.corners[begin + k];
      proxy.quads[face][k] = corner.vertex;
      // Other programs go by these, we by the sidecar: both must mean the same texels.
      const PatchTile& tile = proxy.tiles[face];
      const TexelPlace place = edge_texel(std::max(tile.side, 1u), k, 0);
      const Uv expected = texel_centre(proxy, tile, place.i, place.j);
      const bool has_uv = corner.uv != PolygonCorner::kNone;
      if (!has_uv || !(std::abs(mesh.uvs[corner.uv].u - expected.u) * proxy.map_width < 0.05) ||
          !(std::abs(mesh.uvs[corner.uv].v - expected.v) * proxy.map_height < 0.05))
        refuse(path, "face " + std::to_string(face + 1) +
                         (has_uv ? " has texture coordinates that are not its tile's corners"
                                 : " has no texture coordinates"));
    }
  }
}

Proxy read_proxy(const Sidecar& in, std::string_view mesh, std::string_view map, const std::string& path,
                 const std::string& map_path) {
  Proxy proxy;
  proxy.tiles = read_tiles(in);
  const Json& size = in.at(in.json, "map");
  proxy.map_width = static_cast<std::uint32_t>(in.whole(in.at(size, "width"), kMaxMapSide, "map.width"));
  proxy.map_height = static_cast<std::uint32_t>(in.whole(in.at(size, "height"), kMaxMapSide, "map.height"));
  if (proxy.map_width == 0 || proxy.map_height == 0) in.fail("the map has no texels");
  read_mesh(mesh, path, proxy);
  proxy.map = decode_vdm_exr(map, map_path, proxy.map_width, proxy.map_height);
  if (const auto fault = find_fault(proxy)) refuse(path, "is malformed: " + *fault);
  return proxy;
}

// A link may lead to a proxy and have no sidecar of its own.
std::string find_sidecar(const std::string& path) {
  const std::string beside = proxy_sidecar_path(path);
  std::error_code code;
  return fs::exists(beside, code) ? beside : proxy_sidecar_path(follow_link(path));
}

}  // namespace

std::string proxy_map_path(const std::string& path) {
  return fs::path(path).replace_extension(".vdm.exr").string();
}

std::string proxy_sidecar_path(const std::string& path) {
  return fs::path(path).replace_extension(".vdm.json").string();
}

bool is_proxy(const std::string& path) {
  const std::string extension = fs::path(path).extension().string();
  std::error_code code;
  return (extension == ".obj" || extension == ".OBJ") && fs::exists(find_sidecar(path), code);
}

void refuse_proxy(const std::string& path) {
  if (is_proxy(path))
    throw Error(ErrorKind::kInput, path,
                "is a proxy, and a scan is wanted here; name the scan (" + proxy_sidecar_path(path) +
                    " beside it says of which it was made)");
  // Its quads would pass for the shape.
  if (const auto aside = parse_addressed(path); aside && is_proxy(aside->path))
    throw Error(ErrorKind::kInput, path, "is a file of the proxy " + aside->path + "; name that one");
  std::error_code code;
  const std::string map = proxy_map_path(path);
  if (fs::path(path).extension() == ".obj" && fs::exists(map, code))
    throw Error(ErrorKind::kInput, path,
                "comes without " + proxy_sidecar_path(path) + ", and " + map +
                    " lies beside it: a proxy is three files; bring all, or rename the map");
}

Proxy decode_proxy(std::string_view sidecar, std::string_view mesh, std::string_view map,
                   const std::string& path, ProxyHeader* header) {
  const std::string sidecar_path = proxy_sidecar_path(path), map_path = proxy_map_path(path);
  const Sidecar in{sidecar_path, parse_json(sidecar, sidecar_path)};
  const ProxyHeader head = read_header(in, sidecar.size());
  check_same(mesh, head.mesh_bytes, head.mesh_hash, path, sidecar_path);
  check_same(map, head.map_bytes, head.map_hash, map_path, sidecar_path);
  Proxy proxy = read_proxy(in, mesh, map, path, map_path);
  if (header != nullptr) *header = head;
  return proxy;
}

Proxy load_proxy(const std::string& path, ProxyHeader* header) {
  const std::string sidecar_path = find_sidecar(path);
  const std::string mesh_paths[] = {path, follow_link(path)};
  const std::string map_paths[] = {proxy_map_path(path), proxy_map_path(mesh_paths[1])};
  const std::string all_paths[] = {sidecar_path, mesh_paths[0], map_paths[0], map_paths[1]};
  for (int reads = 1;; ++reads) {
    const std::vector<std::int64_t> states = file_states(all_paths);
    if (std::error_code code; !fs::exists(sidecar_path, code)) refuse_without(path, sidecar_path);
    const InputBytes sidecar = read_input(sidecar_path);
    const Sidecar in{sidecar_path, parse_json(sidecar.view(), sidecar_path)};
    ProxyHeader head = read_header(in, sidecar.size);
    const auto mesh = find_part(mesh_paths, head.mesh_bytes, head.mesh_hash);
    const auto map = find_part(map_paths, head.map_bytes, head.map_hash);
    if (mesh && map) {
      Proxy proxy = read_proxy(in, mesh->bytes.view(), map->bytes.view(), mesh->path, map->path);
      head.map_file = map->path;
      if (header != nullptr) *header = head;
      return proxy;
    }
    if (reads < kMostReads && file_states(all_paths) != states) continue;
    const std::string& missing = mesh ? map_paths[0] : path;
    if (std::error_code code; !fs::exists(missing, code)) refuse_without(path, missing);
    refuse_other(missing, sidecar_path);
  }
}

ProxyHeader save_proxy(const std::string& path, const Proxy& proxy, const ProxySource& source,
                       bool overwrite) {
  if (const auto fault = find_fault(proxy))
    throw Error(ErrorKind::kFailure, path, "would be malformed: " + *fault + "; please report this");
  ProxyOutputs out(path, overwrite);
  ProxyHeader header;
  header.major = kProxyMajor;
  header.minor = kProxyMinor;
  header.source = source;
  {
    const std::string text = encode_mesh(proxy);
    out.mesh.write(text);
    header.mesh_bytes = text.size();
    header.mesh_hash = hash_bytes(text);
  }
  {
    const std::vector<unsigned char> bytes =
        encode_vdm_exr(out.map.path(), proxy.map, proxy.map_width, proxy.map_height);
    const std::string_view view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    out.map.write(view);
    header.map_bytes = view.size();
    header.map_hash = hash_bytes(view);
  }
  const std::string text = encode_sidecar(proxy, header);
  out.sidecar.write(text);
  header.sidecar_bytes = text.size();
  const SetPart parts[] = {{&out.mesh, header.mesh_hash}, {&out.map, header.map_hash}};
  commit_set(out.sidecar, parts);
  return header;
}

void check_proxy_output(const std::string& path, bool overwrite) {
  if (path == "-")
    throw Error(ErrorKind::kUsage, "",
                "a proxy is three files and cannot go to standard output; name an .obj");
  if (fs::path(path).extension() != ".obj")
    throw Error(ErrorKind::kUsage, path,
                "a proxy is an OBJ with two files beside it; give a name that ends in .obj");
  const ProxyOutputs probe(path, overwrite);
}

}  // namespace rbvh
