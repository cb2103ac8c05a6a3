// 3D Tiles 1.1 (OGC 22-025r4): a tree of tiles with a GLB each, of which each is replaced by its children
// where its error would be seen. Levels of the pair are levels of the tree; each is cut along an octree into
// tiles of about kTileElements.
#include "rbvh/tileset.h"

#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "io/input_file.h"
#include "io/output_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/units.h"
#include "pipeline/rbvh/lod.h"
#include "pipeline/rbvh/mesh_texture.h"
#include "pipeline/scene/asset_content.h"
#include "rbvh/frame.h"
#include "rbvh/io.h"
#include "rbvh/mesh.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kTileElements = 50'000;  // triangles or points
constexpr int kDeepest = 10;

/// Of the octree: along x, y and z, each below 2^depth.
using Cell = std::array<std::uint32_t, 3>;

struct Tile {
  Bounds3f bounds;          ///< of what it and the tiles below it hold
  std::string content;      ///< its file's name; empty: none
  std::vector<Cell> below;  ///< of the next finer level
};

struct TileLevel {
  int depth = 0;
  double error = 0;  ///< metres, or scan units where these are not known
  std::map<Cell, Tile> tiles;
};

/// What belongs to these triangles, or points.
Scan part_of(const Scan& scan, const std::vector<std::uint32_t>& elements) {
  Scan part;
  part.shift = scan.shift;
  std::vector<std::uint32_t> vertices;
  if (scan.is_cloud()) {
    vertices = elements;
  } else {
    for (const std::uint32_t t : elements)
      vertices.insert(vertices.end(), scan.triangles[t].begin(), scan.triangles[t].end());
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    const auto moved = [&](std::uint32_t v) {
      return static_cast<std::uint32_t>(std::lower_bound(vertices.begin(), vertices.end(), v) -
                                        vertices.begin());
    };
    for (const std::uint32_t t : elements) {
      const Triangle& corners = scan.triangles[t];
      part.triangles.push_back({moved(corners[0]), moved(corners[1]), moved(corners[2])});
    }
  }
  const auto take = [&](const auto& from, auto& to) {
    if (from.empty()) return;
    for (const std::uint32_t v : vertices) to.push_back(from[v]);
  };
  take(scan.positions, part.positions);
  take(scan.normals, part.normals);
  take(scan.radii, part.radii);
  take(scan.colors, part.colors);
  return part;
}

/// A surface passes through about four times as many cells for each further cut.
int depth_for(std::size_t elements, int least) {
  int depth = least;
  while (depth < kDeepest && elements > kTileElements << (2 * depth)) ++depth;
  return depth;
}

Cell cell_of(Vec3f p, const Bounds3f& box, int depth) {
  const Vec3f extent = box.extent();
  const float side = std::max({extent.x, extent.y, extent.z});
  const auto most = static_cast<float>(1u << depth);
  Cell cell{};
  for (int axis = 0; axis < 3; ++axis)
    cell[static_cast<std::size_t>(axis)] =
        side > 0
            ? static_cast<std::uint32_t>(std::clamp((p[axis] - box.lo[axis]) / side * most, 0.0f, most - 1))
            : 0;
  return cell;
}

std::string file_name(const std::string& level, int depth, const Cell& cell) {
  std::string name = level;
  if (depth > 0)
    for (const std::uint32_t index : cell) name += "-" + std::to_string(index);
  return name + ".glb";
}

/// Writes the tiles of a level, whose mesh is `mesh`. Each has an image of its own of the colours there.
void write_tiles(const Level& of, const Scan& mesh, const Asset& pair, const std::string& folder,
                 TileLevel& level) {
  const std::vector<std::uint32_t> leaves = textured_leaves(of, mesh);
  std::map<Cell, std::vector<std::uint32_t>> cells;
  const std::size_t count = mesh.is_cloud() ? mesh.positions.size() : mesh.triangles.size();
  for (std::uint32_t i = 0; i < count; ++i) {
    Vec3f middle{};
    if (mesh.is_cloud())
      middle = mesh.positions[i];
    else
      for (const std::uint32_t v : mesh.triangles[i]) middle = middle + mesh.positions[v] * (1.0f / 3);
    cells[cell_of(middle, pair.bounds, level.depth)].push_back(i);
  }
  for (const auto& [cell, elements] : cells) {
    Scan part = part_of(mesh, elements);
    if (!leaves.empty()) {
      std::vector<std::uint32_t> of_part;
      for (const std::uint32_t t : elements) of_part.push_back(leaves[t]);
      add_texture(of, of_part, part);
    }
    Tile& tile = level.tiles[cell];
    tile.content = file_name(of.name, level.depth, cell);
    for (const Vec3f& p : part.positions) tile.bounds.add(p);
    write_glb(folder + "/" + tile.content, part, pair.up_axis(), false);
  }
}

/// Each tile under that of the coarser level which holds its cell; made there where nothing is.
void link(TileLevel& coarser, const TileLevel& finer) {
  for (const auto& [cell, tile] : finer.tiles) {
    Cell above = cell;
    for (std::uint32_t& index : above) index >>= finer.depth - coarser.depth;
    Tile& parent = coarser.tiles[above];
    parent.bounds.add(tile.bounds);
    parent.below.push_back(cell);
  }
}

/// Tiles have +Z up: of an asset with +Y up, what viewers make of its GLB.
Vec3d turned(Vec3d p, bool z_is_up) { return z_is_up ? p : Vec3d{p.x, -p.z, p.y}; }

Json tile_json(const std::vector<TileLevel>& levels, std::size_t at, const Cell& cell, bool z_is_up) {
  const Tile& tile = levels[at].tiles.at(cell);
  const Vec3d a = turned(Vec3d(tile.bounds.lo), z_is_up), b = turned(Vec3d(tile.bounds.hi), z_is_up);
  const Vec3d middle = (a + b) * 0.5, half = (b - a) * 0.5;
  Json json = {{"boundingVolume",
                {{"box",
                  {middle.x, middle.y, middle.z, std::abs(half.x), 0, 0, 0, std::abs(half.y), 0, 0, 0,
                   std::abs(half.z)}}}},
               {"geometricError", levels[at].error},
               {"refine", "REPLACE"}};
  if (!tile.content.empty()) json["content"] = {{"uri", tile.content}};
  for (const Cell& below : tile.below) json["children"].push_back(tile_json(levels, at + 1, below, z_is_up));
  return json;
}

/// What the level's surface may be off by; of one whose error is not known, the distance of its vertices.
double error_of(const Rbvh& rbvh, const std::string& name, const Scan& mesh, double diagonal) {
  const double known = known_error(rbvh, *rbvh.find_level(name)).percent / 100 * diagonal;
  return known > 0 ? known
                   : std::sqrt(rbvh.source.area /
                               static_cast<double>(std::max<std::size_t>(1, mesh.positions.size())));
}

/// A folder of its own beside `folder`, which becomes that, or goes.
class NewFolder {
 public:
  NewFolder(const std::string& folder, bool overwrite) : folder_(fs::absolute(folder).lexically_normal()) {
    if (!folder_.has_filename()) folder_ = folder_.parent_path();
    if (fs::exists(folder_)) check_replaceable(overwrite);
    new_ = folder_.string() + ".tmp." + std::to_string(getpid());
    std::error_code code;
    fs::create_directory(new_, code);
    if (code) throw Error(ErrorKind::kFailure, folder, "no folder can be made there: " + code.message());
  }
  ~NewFolder() {
    std::error_code code;
    fs::remove_all(new_, code);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  std::string path() const { return new_.string(); }

  void commit() {
    // An old tileset changes places with the new one at once, and goes under that one's name.
    const unsigned how = fs::exists(folder_) ? RENAME_EXCHANGE : RENAME_NOREPLACE;
    if (renameat2(AT_FDCWD, new_.c_str(), AT_FDCWD, folder_.c_str(), how) != 0)
      throw Error(ErrorKind::kFailure, folder_.string(),
                  std::string("cannot be replaced: ") + std::strerror(errno) + "; give another folder");
  }

 private:
  /// Nothing but our own tilesets is replaced.
  void check_replaceable(bool overwrite) const {
    if (!fs::is_directory(folder_)) throw Error(ErrorKind::kFailure, folder_.string(), "is no folder");
    const fs::path tileset = folder_ / "tileset.json";
    const bool is_ours =
        fs::exists(tileset) &&
        read_input(tileset.string()).view().find("\"generator\": \"rbvh\"") != std::string_view::npos;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
      const std::string name = entry.path().filename().string();
      if (!is_ours || (name != "tileset.json" && entry.path().extension() != ".glb"))
        throw Error(ErrorKind::kFailure, folder_.string(), "holds " + name + ", which is of no tileset");
      if (!overwrite)
        throw Error(ErrorKind::kFailure, folder_.string(),
                    "is not empty; it is overwritten only if asked to");
    }
  }
  fs::path folder_, new_;
};

}  // namespace

TilesetCounts write_tileset(const std::string& folder, const Asset& pair, bool overwrite,
                            const Progress& progress) {
  const std::vector<std::string> names = level_names(pair);
  if (names.empty()) throw Error(ErrorKind::kUsage, pair.path, "is no .rbvh pair");
  const Rbvh& rbvh = *pair.rbvh();
  const auto diagonal = static_cast<double>(pair.bounds.diagonal());
  const bool z_is_up = pair.up_axis() == Vec3d{0, 0, 1};
  NewFolder out(folder, overwrite);
  std::vector<TileLevel> levels(1);  // coarsest first, below a root
  // The transform scales what tiles hold, and not their errors.
  const double meters = unit_meters(rbvh.source.units).value_or(1);
  levels[0].error = diagonal * meters;
  TilesetCounts counts;
  for (std::size_t i = names.size(); i-- > 0;) {
    if (progress)
      progress("tiles", static_cast<double>(names.size() - 1 - i) / static_cast<double>(names.size()));
    const Scan mesh = plain_level_mesh(pair, names[i]);
    TileLevel& level = levels.emplace_back();
    const TileLevel& coarser = levels[levels.size() - 2];
    level.depth = depth_for(mesh.is_cloud() ? mesh.positions.size() : mesh.triangles.size(), coarser.depth);
    level.error = std::min(coarser.error, error_of(rbvh, names[i], mesh, diagonal) * meters);
    write_tiles(*rbvh.find_level(names[i]), mesh, pair, out.path(), level);
    counts.tiles += level.tiles.size();
  }
  for (std::size_t i = levels.size() - 1; i-- > 0;) link(levels[i], levels[i + 1]);
  // A coarsest level of one tile is the root itself.
  const std::size_t root = levels[1].depth == 0 ? 1 : 0;
  Json json = {{"asset", {{"version", "1.1"}, {"generator", "rbvh"}}},
               {"geometricError", levels[0].error},
               {"root", tile_json(levels, root, Cell{}, z_is_up)}};
  const Vec3d shift = turned(rbvh.source.shift, z_is_up);
  json["root"]["transform"] = {
      meters,           0, 0, 0, 0, meters, 0, 0, 0, 0, meters, 0, shift.x * meters, shift.y * meters,
      shift.z * meters, 1};
  OutputFile file(out.path() + "/tileset.json", false);
  file.write(json.dump(1) + "\n");
  file.commit();
  for (const fs::directory_entry& entry : fs::directory_iterator(out.path()))
    counts.bytes += entry.file_size();
  out.commit();
  return counts;
}

}  // namespace rbvh
