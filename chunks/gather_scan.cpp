#include "chunks/gather_scan.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <span>

#include "chunks/chunk_folder.h"
#include "chunks/complete_cells.h"
#include "chunks/scan_pieces.h"
#include "io/input_file.h"
#include "io/load_source.h"
#include "io/output_file.h"
#include "io/property_names.h"
#include "io/proxy_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/text.h"
#include "pipeline/scan/cut_polygons.h"
#include "pipeline/scan/float_shift.h"
#include "pipeline/scan/normals.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

constexpr const char *kVertices = "vertices.work", *kFaces = "faces.work", *kCutFaces = "cut.work";
/// The result; of triangles that share no vertices under a name of its own.
constexpr const char* kNoFaces = "no face is left after cleaning";
constexpr const char *kShared = "scan.ply", *kApart = "triangles.ply";

std::string in_folder(const std::string& folder, const char* name) {
  return (fs::path(folder) / name).string();
}

bool is_flat(const WorkFace& face) {
  const auto& [a, b, c] = face.corners;
  return a == b || b == c || c == a;
}

/// The inputs one after the other, as files of all their vertices and faces.
class Gatherer {
 public:
  Gatherer(const std::string& folder, std::size_t inputs)
      : vertices_(in_folder(folder, kVertices), true),
        faces_(in_folder(folder, kFaces), true),
        has_ids_(inputs > 1) {}

  void begin_input(const std::string& path) {
    path_ = path;
    first_vertex_ = vertices;
    first_face_ = faces;
    first_id_ = has_ids_ && last_id_ >= 0 ? last_id_ + 1 : 0;
    largest_corner_ = 0;
  }
  void add(ScanPiece&& all) {
    const RawScan& piece = all.scan;
    if (!is_begun_) {
      shift = piece.shift;
      units = piece.units;
    }
    if (is_begun_ && piece.units != units)
      throw Error(ErrorKind::kInput, path_, "the inputs state different units; ingest them one by one");
    is_begun_ = true;
    add_vertices(piece);
    add_faces(all);
  }
  void end_input() {
    if (vertices == first_vertex_) throw Error(ErrorKind::kInput, path_, "has no vertices");
    if (faces > first_face_ && largest_corner_ >= vertices - first_vertex_)
      throw Error(ErrorKind::kInput, path_,
                  "the vertex " + std::to_string(largest_corner_ + 1) +
                      " of a face is out of range (there are " + std::to_string(vertices - first_vertex_) +
                      " vertices)");
    const bool is_mesh = faces > first_face_;
    if (first_vertex_ == 0) is_mesh_ = is_mesh;
    if (is_mesh != is_mesh_)
      throw Error(ErrorKind::kInput, path_, "a mesh and a cloud cannot be merged; build them one by one");
  }
  void commit() {
    flush(vertices_, vertex_buffer_);
    flush(faces_, face_buffer_);
    vertices_.commit();
    faces_.commit();
  }

  std::uint64_t vertices = 0, faces = 0, without_normal = 0, without_radius = 0, colored = 0, flat = 0;
  std::vector<std::uint32_t> not_finite;
  Vec3d shift{};
  std::string units;
  Bounds3d box;
  bool has_polygons = false;
  bool has_ids() const { return has_ids_; }

 private:
  template <class T>
  void flush(OutputFile& file, std::vector<T>& buffer) {
    file.write(std::as_bytes(std::span<const T>(buffer)));
    buffer.clear();
  }
  template <class T>
  void put(OutputFile& file, std::vector<T>& buffer, const T& value) {
    buffer.push_back(value);
    if (buffer.size() == kBuffered) flush(file, buffer);
  }

  std::int32_t id_of(const std::vector<std::int32_t>& ids, std::size_t i) {
    const std::int32_t own = ids.empty() ? 0 : ids[i];
    if (own != 0) has_ids_ = true;
    if (first_id_ > 0 && own < 0)
      throw Error(ErrorKind::kInput, path_, "has negative object ids, which cannot be merged");
    const std::int64_t id = std::int64_t{first_id_} + own;
    if (id > std::numeric_limits<std::int32_t>::max())
      throw Error(ErrorKind::kInput, path_, "the object ids of the inputs are too large to be merged");
    last_id_ = std::max(last_id_, static_cast<std::int32_t>(id));
    return static_cast<std::int32_t>(id);
  }

  void add_vertices(const RawScan& piece) {
    const Vec3d move = piece.shift - shift;
    for (std::size_t i = 0; i < piece.positions.size(); ++i) {
      if (vertices >= 0xfffffffeu)
        throw Error(ErrorKind::kInput, path_, "the inputs have more than 4294967294 vertices in all");
      const Vec3d p = piece.positions[i] + move;
      const Vec3f normal = piece.normals.empty() ? Vec3f{} : piece.normals[i];
      const float radius = piece.radii.empty() ? 0 : piece.radii[i];
      const bool has_normal = is_direction(normal), has_radius = std::isfinite(radius) && radius > 0;
      const Color8 color = piece.colors.empty() ? Color8{255, 255, 255} : piece.colors[i];
      WorkVertex vertex{.position = {p.x, p.y, p.z},
                        .normal = {},
                        .radius = has_radius ? radius : 0,
                        .object_id = 0,
                        .color = {color[0], color[1], color[2]},
                        .is_dropped = 0};
      if (piece.triangles.empty()) vertex.object_id = static_cast<float>(id_of(piece.object_ids, i));
      if (is_finite(static_cast<Vec3f>(p))) {
        box.add(p);
        for (int axis = 0; has_normal && axis < 3; ++axis) vertex.normal[axis] = normal[axis];
        without_normal += !has_normal;
        without_radius += !has_radius;
        colored += !piece.colors.empty();
      } else {
        not_finite.push_back(static_cast<std::uint32_t>(vertices));
        if (not_finite.size() > kMostNotFinite)
          throw Error(ErrorKind::kInput, path_, "has millions of vertices that are not finite");
        vertex.is_dropped = 1;
        for (double& coordinate : vertex.position) coordinate = 0;
      }
      put(vertices_, vertex_buffer_, vertex);
      ++vertices;
    }
  }

  void add_faces(const ScanPiece& all) {
    const RawScan& piece = all.scan;
    bool is_inside = false;  // a polygon that began before
    for (std::size_t i = 0; i < piece.triangles.size(); ++i) {
      const std::uint32_t fan = all.fans.empty() ? 1 : all.fans[i];
      WorkFace face{piece.triangles[i], id_of(piece.object_ids, i), fan};
      for (std::uint32_t& corner : face.corners) {
        largest_corner_ = std::max<std::uint64_t>(largest_corner_, corner);
        corner = static_cast<std::uint32_t>(
            std::min<std::uint64_t>(first_vertex_ + corner, std::numeric_limits<std::uint32_t>::max()));
      }
      const bool is_polygon = is_inside || fan > 1;
      is_inside = fan > 1;
      has_polygons |= is_polygon;
      if (!is_polygon && is_flat(face)) {
        ++flat;
        continue;
      }
      put(faces_, face_buffer_, face);
      ++faces;
    }
  }

  static constexpr std::size_t kBuffered = 1 << 14, kMostNotFinite = 1 << 24;
  OutputFile vertices_, faces_;
  std::vector<WorkVertex> vertex_buffer_;
  std::vector<WorkFace> face_buffer_;
  std::string path_;
  std::uint64_t first_vertex_ = 0, first_face_ = 0, largest_corner_ = 0;
  std::int32_t first_id_ = 0, last_id_ = -1;
  bool has_ids_ = false, is_begun_ = false, is_mesh_ = false;
};

/// Entries of a file, all of type T, in pieces.
template <class T, class Visit>
void for_each_entry(const std::string& path, const Visit& visit) {
  InputStream in(path);
  std::vector<T> entries(1 << 14);
  for (std::size_t got = 1; got > 0;) {
    got = in.read(std::as_writable_bytes(std::span(entries))) / sizeof(T);
    for (std::size_t i = 0; i < got; ++i) visit(entries[i]);
  }
}

/// Collects values for a file.
struct Sink {
  OutputFile file;
  std::vector<std::byte> bytes{};

  explicit Sink(const std::string& path) : file(path, true) {}
  template <class T>
  void put(const T& value) {
    const auto* first = reinterpret_cast<const std::byte*>(&value);
    bytes.insert(bytes.end(), first, first + sizeof value);
    if (bytes.size() < (1 << 20)) return;
    file.write(bytes);
    bytes.clear();
  }
  void commit() {
    file.write(bytes);
    file.commit();
  }
};

/// Cuts polygons that a fan does not fill, now that all vertices are known, and leaves out what has no area.
class PolygonPass {
 public:
  PolygonPass(const Gatherer& all, std::uint64_t cache_bytes, const std::string& folder)
      : vertices_(open_work_vertices(in_folder(folder, kVertices), all.vertices, folder)),
        positions_(vertices_, float_shift(all.box), cache_bytes),
        not_finite_(all.not_finite),
        out_(in_folder(folder, kCutFaces)) {}

  void add(const WorkFace& face) {
    batch_.push_back(face);
    if (face.fan <= 1 && batch_.size() >= kBatch) flush();
  }
  void commit() {
    flush();
    out_.commit();
  }

  PolygonFaults faults;
  std::uint64_t faces = 0, flat = 0;

 private:
  static constexpr std::size_t kBatch = 1 << 15;
  static constexpr Vec3d kNowhere{std::numeric_limits<double>::quiet_NaN(), 0, 0};

  void flush() {
    Fans fans;
    std::vector<Triangle> triangles;  // by numbers of `points`
    std::vector<std::uint32_t> vertices;
    std::vector<Vec3d> points;
    for (std::size_t i = 0; i < batch_.size(); ++i) {
      for (const std::uint32_t corner : batch_[i].corners) {
        vertices.push_back(corner);
        const bool is_lost = std::binary_search(not_finite_.begin(), not_finite_.end(), corner);
        points.push_back(is_lost ? kNowhere : Vec3d(positions_.at(corner)));
      }
    }
    for (std::size_t i = 0, count = 1; i < batch_.size(); i += count) {
      count = batch_[i].fan;
      for (std::size_t k = i; k < i + count; ++k) {
        const auto first = static_cast<std::uint32_t>(3 * k);
        triangles.push_back({first, first + 1, first + 2});
      }
      fans.add(triangles.size(), count);
    }
    const PolygonFaults found = fans.cut_again(points, triangles);
    faults.crossing += found.crossing;
    faults.too_many += found.too_many;
    for (std::size_t i = 0; i < batch_.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) batch_[i].corners[c] = vertices[triangles[i][c]];
      batch_[i].fan = 1;
      if (is_flat(batch_[i])) {
        ++flat;
        continue;
      }
      out_.put(batch_[i]);
      ++faces;
    }
    batch_.clear();
  }

  BigPly vertices_;
  VertexCache positions_;
  const std::vector<std::uint32_t>& not_finite_;  // ascend
  Sink out_;
  std::vector<WorkFace> batch_;
};

/// Which columns scan.ply has, and how many entries.
struct PlyPlan {
  std::uint64_t vertices = 0, faces = 0;
  bool has_normals = false, has_radii = false, has_colors = false, has_ids = false;
  Vec3d moved{}, shift{};
  std::string units;
};

std::string header_of(const PlyPlan& plan) {
  char text[120];
  std::snprintf(text, sizeof text, "comment rbvh shift %.17g %.17g %.17g\n", plan.shift.x, plan.shift.y,
                plan.shift.z);
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  if (plan.shift != Vec3d{}) header += text;
  if (!plan.units.empty()) header += "comment rbvh units " + plan.units + "\n";
  header += "element vertex " + std::to_string(plan.vertices) +
            "\nproperty float x\nproperty float y\nproperty float z\n";
  if (plan.has_normals) header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (plan.has_radii) header += "property float radius\n";
  if (plan.has_colors) header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const bool is_mesh = plan.faces > 0;
  if (plan.has_ids && !is_mesh) header += "property float object_id\n";
  if (is_mesh)
    header += "element face " + std::to_string(plan.faces) + "\nproperty list uchar uint vertex_indices\n" +
              (plan.has_ids ? "property int object_id\n" : "");
  return header + "end_header\n";
}

bool is_kept(const WorkFace& face, const std::vector<std::uint32_t>& not_finite) {
  return std::none_of(face.corners.begin(), face.corners.end(), [&](std::uint32_t v) {
    return std::binary_search(not_finite.begin(), not_finite.end(), v);
  });
}

void write_scan_ply(const std::string& folder, const char* name, const PlyPlan& plan,
                    const std::vector<std::uint32_t>& not_finite) {
  Sink out(in_folder(folder, name));
  out.file.write(header_of(plan));
  const bool is_mesh = plan.faces > 0;
  for_each_entry<WorkVertex>(in_folder(folder, kVertices), [&](const WorkVertex& vertex) {
    if (!is_mesh && vertex.is_dropped != 0) return;
    const Vec3d p = Vec3d{vertex.position[0], vertex.position[1], vertex.position[2]} - plan.moved;
    out.put(vertex.is_dropped != 0 ? Vec3f{} : static_cast<Vec3f>(p));
    if (plan.has_normals) out.put(vertex.normal);
    if (plan.has_radii) out.put(vertex.radius);
    if (plan.has_colors) out.put(vertex.color);
    if (plan.has_ids && !is_mesh) out.put(vertex.object_id);
  });
  if (is_mesh)
    for_each_entry<WorkFace>(in_folder(folder, kFaces), [&](const WorkFace& face) {
      if (!is_kept(face, not_finite)) return;
      out.put(std::uint8_t{3});
      out.put(face.corners);
      if (plan.has_ids) out.put(face.object_id);
    });
  out.commit();
}

PlyPlan plan_of(const Gatherer& all) {
  const bool is_mesh = all.faces > 0;
  PlyPlan plan{.vertices = all.vertices,
               .faces = all.faces,
               .has_normals = !is_mesh || all.without_normal == 0,
               .has_radii = !is_mesh,
               .has_colors = all.colored > 0,
               .has_ids = all.has_ids(),
               .moved = float_shift(all.box),
               .shift = {},
               .units = all.units};
  plan.shift = all.shift + plan.moved;
  return plan;
}

/// What was left out, guessed and completed.
void note_counts(const Gatherer& all, const CompletedCells& completed, std::vector<std::string>& notes) {
  const auto add = [&](std::uint64_t count, const char* noun, const std::string& what) {
    if (count > 0) notes.push_back(counted(count, noun) + " " + what);
  };
  add(all.not_finite.size(), "vertex", "not finite: left out");
  add(all.flat, "face", "without area: left out");
  add(completed.duplicates, "point", "equal to others: left out");
  const std::string where = ", in " + counted(completed.cells, "cell");
  add(completed.normals, "normal", "estimated" + where);
  add(completed.radii, "radius", "estimated" + where);
  if (all.faces > 0 && all.without_normal > 0 && all.without_normal < all.vertices)
    notes.push_back("some vertices have no normals: all follow from the faces");
}

GatheredScan open_gathered(const std::vector<std::string>& inputs, const std::string& folder,
                           const char* name, std::vector<std::string> notes) {
  std::optional<BigPly> ply = open_big_ply(in_folder(folder, name));
  RBVH_CHECK(ply.has_value());
  ply->path = joined_name(inputs);
  ply->corners_apart = name == kApart;
  return {std::move(*ply), std::move(notes)};
}

/// Reads all inputs; what is noted of each gets its name.
bool gather_inputs(const std::vector<std::string>& inputs, const MemoryBudget& memory, Gatherer& to,
                   std::vector<std::string>& notes, const Progress& progress) {
  bool corners_apart = true;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    report(progress, "gather", static_cast<double>(i) / static_cast<double>(inputs.size()));
    refuse_proxy(inputs[i]);
    to.begin_input(inputs[i]);
    const PiecesRead read =
        read_in_pieces(inputs[i], memory, [&](ScanPiece&& piece) { to.add(std::move(piece)); });
    to.end_input();
    corners_apart &= read.corners_apart;
    for (const std::string& note : read.notes) notes.push_back(input_name(inputs[i]) + ": " + note);
  }
  report(progress, "gather", 1);
  to.commit();
  return corners_apart;
}

ScanSize estimate_size(const std::string& input) {
  ScanSize size;
  std::error_code code;
  size.bytes = fs::file_size(input, code);
  if (code || !can_be_in_pieces(input)) return {};
  if (const std::optional<BigPly> ply = open_big_ply(input))
    return {ply->bytes, ply->vertices.count, ply->primitives()};
  const std::string extension = lower(fs::path(input).extension().string());
  const bool is_obj = extension == ".obj", is_stl = extension == ".stl";
  size.primitives = size.bytes / (is_obj || is_stl ? 50 : 20);  // usual lines, triangles and points
  size.vertices = is_obj ? size.primitives / 2 : is_stl ? 3 * size.primitives : size.primitives;
  return size;
}

void cut_polygons(Gatherer& all, const std::string& folder, const MemoryBudget& memory,
                  std::vector<std::string>& notes) {
  PolygonPass pass(all, memory_limit(memory) / 4, folder);
  for_each_entry<WorkFace>(in_folder(folder, kFaces), [&](const WorkFace& face) { pass.add(face); });
  pass.commit();
  fs::rename(in_folder(folder, kCutFaces), in_folder(folder, kFaces));
  all.faces = pass.faces;
  all.flat += pass.flat;
  add_notes(pass.faults, notes);
}

}  // namespace

GatheredScan gather_scan(const std::vector<std::string>& inputs, const std::string& folder,
                         const ChunkConfig& chunks, const Progress& progress) {
  GatheredScan gathered;
  for (const char* name : {kShared, kApart})
    if (fs::exists(in_folder(folder, name))) return open_gathered(inputs, folder, name, {});
  std::vector<std::string>& notes = gathered.notes;
  Gatherer all(folder, inputs.size());
  const bool corners_apart = gather_inputs(inputs, chunks.memory, all, notes, progress);
  if (all.box.empty())
    throw Error(ErrorKind::kInput, joined_name(inputs), "has no point with finite coordinates");
  if (all.has_polygons) {
    cut_polygons(all, folder, chunks.memory, notes);
    if (all.faces == 0) throw Error(ErrorKind::kInput, joined_name(inputs), kNoFaces);
  }
  CompletedCells completed;
  if (all.faces == 0 && all.without_normal + all.without_radius > 0)
    completed =
        complete_cells(open_work_vertices(in_folder(folder, kVertices), all.vertices, joined_name(inputs)),
                       all.box, folder, chunks, progress);
  PlyPlan plan = plan_of(all);
  if (all.faces == 0) plan.vertices -= completed.duplicates + all.not_finite.size();
  if (all.faces > 0 && !all.not_finite.empty()) {
    plan.faces = 0;
    for_each_entry<WorkFace>(in_folder(folder, kFaces),
                             [&](const WorkFace& face) { plan.faces += is_kept(face, all.not_finite); });
  }
  if (all.faces > 0 && plan.faces == 0) throw Error(ErrorKind::kInput, joined_name(inputs), kNoFaces);
  note_counts(all, completed, notes);
  const char* const name = corners_apart ? kApart : kShared;
  write_scan_ply(folder, name, plan, all.not_finite);
  fs::remove(in_folder(folder, kVertices));
  fs::remove(in_folder(folder, kFaces));
  return open_gathered(inputs, folder, name, std::move(notes));
}

ScanSize estimate_size(const std::vector<std::string>& inputs) {
  ScanSize all;
  for (const std::string& input : inputs) {
    const ScanSize size = estimate_size(input);
    all.bytes += size.bytes;
    all.vertices += size.vertices;
    all.primitives += size.primitives;
  }
  return all;
}

bool is_gathered(const BigPly& ply) { return !ply.is_cloud() || (ply.has_normals && ply.has_radii); }

}  // namespace rbvh
