#include "chunks/load_cell.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "io/input_file.h"
#include "io/ply.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

/// A set of numbers below `count`, and how many of it are below each.
class NumberSet {
 public:
  explicit NumberSet(std::uint64_t count) : words_((count + 63) / 64, 0) {}
  void add(std::uint32_t i) { words_[i / 64] |= std::uint64_t{1} << i % 64; }
  bool has(std::uint32_t i) const { return (words_[i / 64] >> i % 64 & 1) != 0; }
  /// Before rank() is asked.
  std::uint32_t count() {
    std::uint32_t all = 0;
    before_.resize(words_.size());
    for (std::size_t w = 0; w < words_.size(); ++w) {
      before_[w] = all;
      all += static_cast<std::uint32_t>(std::popcount(words_[w]));
    }
    return all;
  }
  std::uint32_t rank(std::uint32_t i) const {
    const std::uint64_t below = words_[i / 64] & ((std::uint64_t{1} << i % 64) - 1);
    return before_[i / 64] + static_cast<std::uint32_t>(std::popcount(below));
  }
  const std::vector<std::uint64_t>& words() const { return words_; }

 private:
  std::vector<std::uint64_t> words_;
  std::vector<std::uint32_t> before_;
};

std::vector<CellRecord> read_records(const std::string& path) {
  InputStream in(path);
  const std::uint64_t bytes = in.file_bytes().value_or(0);
  std::vector<CellRecord> records(static_cast<std::size_t>(bytes / sizeof(CellRecord)));
  const std::span<std::byte> to = std::as_writable_bytes(std::span(records));
  if (bytes % sizeof(CellRecord) != 0 || in.read(to) != to.size())
    throw Error(ErrorKind::kInput, path, "is cut; build without resuming");
  return records;
}

/// Numbers of a cell's vertices: its own in their order, then the others in theirs.
struct VertexNumbers {
  NumberSet own, near;  ///< near: and not own
  std::uint32_t own_count = 0, near_count = 0;
  std::uint32_t operator()(std::uint32_t vertex) const {
    return own.has(vertex) ? own.rank(vertex) : own_count + near.rank(vertex);
  }
};

VertexNumbers number_vertices(std::span<const CellRecord> records, std::uint64_t vertices) {
  VertexNumbers numbers{NumberSet(vertices), NumberSet(vertices)};
  for (const CellRecord& record : records)
    if (record.is_own != 0)
      for (const std::uint32_t v : record.corners) numbers.own.add(v);
  for (const CellRecord& record : records)
    if (record.is_own == 0)
      for (const std::uint32_t v : record.corners)
        if (!numbers.own.has(v)) numbers.near.add(v);
  numbers.own_count = numbers.own.count();
  numbers.near_count = numbers.near.count();
  return numbers;
}

constexpr std::uint64_t kBlockVertices = 8192;

/// Appends the entries of a set of vertices.
void append_vertices(const BigPly& ply, const NumberSet& set, std::string& bytes) {
  std::vector<std::byte> block;
  const std::vector<std::uint64_t>& words = set.words();
  for (std::uint64_t first = 0; first < ply.vertices.count; first += kBlockVertices) {
    const std::uint64_t last = std::min(first + kBlockVertices, ply.vertices.count);
    const auto begin = words.begin() + static_cast<std::ptrdiff_t>(first / 64),
               end = words.begin() + static_cast<std::ptrdiff_t>((last + 63) / 64);
    if (std::all_of(begin, end, [](std::uint64_t word) { return word == 0; })) continue;
    block.resize(static_cast<std::size_t>(last - first) * ply.vertices.bytes);
    read_at(ply, ply.vertices.at + first * ply.vertices.bytes, block);
    for (std::uint64_t v = first; v < last; ++v)
      if (set.has(static_cast<std::uint32_t>(v)))
        bytes.append(reinterpret_cast<const char*>(block.data()) + (v - first) * ply.vertices.bytes,
                     ply.vertices.bytes);
  }
}

std::string header_of(const BigPly& ply, std::uint64_t vertices, std::uint64_t faces) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(vertices) + "\n";
  for (const ply::Property& property : ply.header.elements[0].properties)
    text += std::string("property ") + ply::name_of(property.type) + " " + property.name + "\n";
  if (!ply.is_cloud())
    text += "element face " + std::to_string(faces) + "\nproperty list uchar uint vertex_indices\n" +
            (ply.object_id ? "property int object_id\n" : "");
  return text + "end_header\n";
}

template <class T>
void append(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof raw);
  bytes.append(raw, sizeof raw);
}

/// The cell as a PLY file in memory: what the scan's vertices have is then read as of any other.
std::string cell_ply(const BigPly& ply, std::span<const CellRecord> records, const VertexNumbers& numbers) {
  std::string bytes = header_of(ply, std::uint64_t{numbers.own_count} + numbers.near_count, records.size());
  const std::size_t face = ply.is_cloud() ? 0 : 13 + (ply.object_id ? 4 : 0);
  bytes.reserve(bytes.size() + (std::size_t{numbers.own_count} + numbers.near_count) * ply.vertices.bytes +
                records.size() * face);
  append_vertices(ply, numbers.own, bytes);
  append_vertices(ply, numbers.near, bytes);
  if (ply.is_cloud()) return bytes;
  for (const std::uint32_t is_own : {1u, 0u})
    for (const CellRecord& record : records) {
      if (record.is_own != is_own) continue;
      append(bytes, std::uint8_t{3});
      for (const std::uint32_t v : record.corners) append(bytes, numbers(v));
      if (ply.object_id) append(bytes, record.object_id);
    }
  return bytes;
}

/// Of each own vertex whether triangles of others may meet it: one near the cell does, at this place, or the
/// vertex lies in another cell.
std::vector<std::uint8_t> find_met(const LoadedCell& cell, const SpaceGrid& grid, const CellPlan& plan,
                                   std::size_t number) {
  const Scan& scan = cell.scan;
  std::vector<std::uint32_t> places(scan.positions.size());
  meshopt_generateVertexRemap(places.data(), nullptr, places.size(), scan.positions.data(), places.size(),
                              sizeof(Vec3f));
  std::vector<std::uint8_t> is_near(places.size(), 0), stays(cell.part.own_vertices, 0);
  for (std::size_t i = cell.part.own_primitives; i < scan.triangles.size(); ++i)
    for (const std::uint32_t v : scan.triangles[i]) is_near[places[v]] = 1;
  for (std::size_t v = 0; v < stays.size(); ++v)
    stays[v] =
        is_near[places[v]] != 0 || plan.cell_of_box[SpaceGrid::index(grid.place(scan.positions[v]))] != number
            ? 1
            : 0;
  return stays;
}

/// Makes one vertex of those at one place, of triangles that share none. Own ones stay before the others.
void weld(LoadedCell& cell) {
  Scan& scan = cell.scan;
  for (Vec3f& p : scan.positions) p = p + Vec3f{};  // -0 becomes 0
  std::vector<std::uint32_t> vertex(scan.positions.size());
  const std::size_t count = meshopt_generateVertexRemap(vertex.data(), nullptr, vertex.size(),
                                                        scan.positions.data(), vertex.size(), sizeof(Vec3f));
  std::uint32_t own = 0;
  for (std::uint32_t v = 0; v < cell.part.own_vertices; ++v) own = std::max(own, vertex[v] + 1);
  meshopt_remapVertexBuffer(scan.positions.data(), scan.positions.data(), vertex.size(), sizeof(Vec3f),
                            vertex.data());
  scan.positions.resize(count);
  for (Triangle& triangle : scan.triangles)
    for (std::uint32_t& corner : triangle) corner = vertex[corner];
  cell.part.own_vertices = own;
}

Scan to_scan(RawScan&& raw, const ScanSurvey& survey) {
  Scan scan;
  scan.positions.resize(raw.positions.size());
  for (std::size_t i = 0; i < raw.positions.size(); ++i)
    scan.positions[i] = static_cast<Vec3f>(raw.positions[i] - survey.moved);
  raw.positions = {};
  static_cast<ScanAttributes&>(scan) = std::move(static_cast<ScanAttributes&>(raw));
  scan.shift = survey.shift;
  scan.units = survey.ply.header.units;
  return scan;
}

}  // namespace

std::uint64_t cell_memory(const BigPly& ply, std::uint64_t primitives) {
  // Records, the PLY file of it and what is read from that.
  const std::uint64_t vertices =
      primitives * ply.vertices.count / std::max<std::uint64_t>(1, ply.primitives());
  return primitives * (sizeof(CellRecord) + 17 + 16) + vertices * (2 * ply.vertices.bytes + sizeof(Vec3d));
}

std::vector<std::uint32_t> own_points(const std::string& folder, std::size_t cell) {
  std::vector<std::uint32_t> numbers;
  for (const CellRecord& record : read_records(cell_path(folder, cell)))
    if (record.is_own != 0) numbers.push_back(record.corners[0]);
  return numbers;
}

LoadedCell load_cell(const ScanSurvey& survey, const SpaceGrid& grid, const CellPlan& plan,
                     const std::string& folder, std::size_t number) {
  const BigPly& ply = survey.ply;
  LoadedCell cell;
  {
    const std::vector<CellRecord> records = read_records(cell_path(folder, number));
    for (const CellRecord& record : records)
      if (std::any_of(record.corners.begin(), record.corners.end(),
                      [&](std::uint32_t v) { return v >= ply.vertices.count; }))
        throw Error(ErrorKind::kInput, cell_path(folder, number), "is damaged; build without resuming");
    cell.part.own_primitives = static_cast<std::uint32_t>(std::count_if(
        records.begin(), records.end(), [](const CellRecord& record) { return record.is_own != 0; }));
    std::string bytes;
    {
      const VertexNumbers numbers = number_vertices(records, ply.vertices.count);
      cell.part.own_vertices = numbers.own_count;
      bytes = cell_ply(ply, records, numbers);
    }
    cell.scan = to_scan(read_ply(bytes, ply.path), survey);
  }
  if (ply.corners_apart) weld(cell);
  cell.part.box = survey.box;
  cell.part.vertices = ply.vertices.count;
  cell.part.triangles = ply.faces.count;
  if (!ply.is_cloud()) cell.part.stays = find_met(cell, grid, plan, number);
  return cell;
}

}  // namespace rbvh
