#include "chunks/complete_cells.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <span>

#include "chunks/load_cell.h"
#include "io/output_file.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/scan/clean.h"
#include "pipeline/scan/compact.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scan/float_shift.h"
#include "pipeline/scan/normals.h"

namespace rbvh {
namespace {

/// A point with its neighbours, as ingest takes it, with those of near cells and uneven cells; and what the
/// process takes before.
constexpr std::uint64_t kBytesPerPoint = 1100, kProcessBytes = std::uint64_t{200} << 20;
constexpr std::uint32_t kMostCells = 256;
/// Up to 64 neighbours span 4.5 spacings, and a radius depends on its neighbours' neighbours.
constexpr float kMarginSpacings = 9;
/// Of the points, whose spacings the margin is for.
constexpr double kMostPoints = 0.99;
constexpr std::uint64_t kBlockVertices = 8192;

/// The spacing that most points have at most, if they lie on a surface as large as the boxes that it meets.
float spacing_of(const SpaceGrid& grid) {
  float sides[] = {grid.box.x, grid.box.y, grid.box.z};
  std::sort(std::begin(sides), std::end(sides));
  const float side = std::sqrt(std::max(sides[1], sides[2] / 16) * sides[2]);  // of a line of points, too
  std::vector<std::uint32_t> counts;
  std::uint64_t all = 0;
  for (const std::uint32_t count : grid.counts)
    if (count > 0) {
      counts.push_back(count);
      all += count;
    }
  std::sort(counts.begin(), counts.end(), std::greater<>());
  std::uint64_t before = 0;
  for (const std::uint32_t count : counts) {
    before += count;
    if (static_cast<double>(before) >= kMostPoints * static_cast<double>(all))
      return side / std::sqrt(static_cast<float>(count));
  }
  return side;
}

bool are_beside(const Cell& a, const Cell& b) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (a.hi[axis] < b.lo[axis] || b.hi[axis] < a.lo[axis]) return false;
  return true;
}

/// From the highest cell on, whose surface faces up where it is open, to those beside it.
std::vector<std::size_t> order_cells(const std::vector<Cell>& cells) {
  std::vector<std::size_t> by_height(cells.size()), order;
  for (std::size_t i = 0; i < cells.size(); ++i) by_height[i] = i;
  std::stable_sort(by_height.begin(), by_height.end(),
                   [&](std::size_t a, std::size_t b) { return cells[a].hi[2] > cells[b].hi[2]; });
  std::vector<std::uint8_t> is_in(cells.size(), 0);
  for (const std::size_t first : by_height) {
    if (is_in[first] != 0) continue;
    is_in[first] = 1;
    order.push_back(first);
    for (std::size_t k = order.size() - 1; k < order.size(); ++k)
      for (const std::size_t next : by_height)
        if (is_in[next] == 0 && are_beside(cells[order[k]], cells[next])) {
          is_in[next] = 1;
          order.push_back(next);
        }
  }
  return order;
}

void write_at(const BigPly& ply, std::uint64_t byte, std::span<const std::byte> from) {
  while (!from.empty()) {
    const ssize_t put = ::pwrite(*ply.file, from.data(), from.size(), static_cast<off_t>(byte));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) fail_output(ply.path, "what is gathered of it cannot be written", errno);
    from = from.subspan(static_cast<std::size_t>(put));
    byte += static_cast<std::uint64_t>(put);
  }
}

/// Calls change(vertex, k) for the k-th of the numbers, which ascend.
template <class Change>
void change_vertices(const BigPly& ply, std::span<const std::uint32_t> numbers, const Change& change) {
  std::vector<WorkVertex> block;
  for (std::size_t k = 0; k < numbers.size();) {
    const std::uint64_t first = numbers[k] / kBlockVertices * kBlockVertices,
                        last = std::min(first + kBlockVertices, ply.vertices.count);
    block.resize(static_cast<std::size_t>(last - first));
    read_at(ply, first * sizeof(WorkVertex), std::as_writable_bytes(std::span(block)));
    for (; k < numbers.size() && numbers[k] < last; ++k) change(block[numbers[k] - first], k);
    write_at(ply, first * sizeof(WorkVertex), std::as_bytes(std::span(block)));
  }
}

/// Completes the points of a cell, which are the scan's first ones and have these numbers.
void complete_own(const BigPly& vertices, Scan& scan, std::span<const std::uint32_t> numbers,
                  CompletedCells& counts) {
  std::vector<std::uint8_t> keep(scan.positions.size(), 1);
  const std::vector<std::uint32_t> first_equal = first_equal_vertices(scan, true);
  const std::vector<float>& is_dropped = scan.properties.at(0).values;
  for (std::size_t i = 0; i < keep.size(); ++i) keep[i] = first_equal[i] == i && is_dropped[i] == 0 ? 1 : 0;
  std::vector<std::size_t> place(numbers.size(), 0);  // of each own point among those that are kept
  std::size_t kept = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    place[i] = kept;
    kept += keep[i];
    if (keep[i] == 0) {
      ++counts.duplicates;
      continue;
    }
    counts.normals += !is_direction(scan.normals[i]);
    counts.radii += !(scan.radii[i] > 0);
  }
  keep_vertices(scan, keep);
  complete_cloud(scan, {});
  change_vertices(vertices, numbers, [&](WorkVertex& vertex, std::size_t k) {
    vertex.is_dropped = keep[k] == 0 ? 1 : 0;
    if (keep[k] == 0) return;
    const Vec3f normal = scan.normals[place[k]];
    for (int axis = 0; axis < 3; ++axis) vertex.normal[axis] = normal[axis];
    vertex.radius = scan.radii[place[k]];
  });
}

std::uint32_t choose_cells(const BigPly& vertices, const ChunkConfig& chunks) {
  if (chunks.chunks > 0) return chunks.chunks;
  const std::uint64_t limit = memory_limit(chunks.memory), bytes = vertices.vertices.count * kBytesPerPoint;
  const std::uint64_t room = limit > 2 * kProcessBytes ? limit - kProcessBytes : kProcessBytes;
  const std::uint64_t count = bytes / room + 1;
  if (count > kMostCells)
    check_budget(chunks.memory, bytes / kMostCells + kProcessBytes, vertices.path,
                 "completing its points in " + std::to_string(kMostCells) + " cells");
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(count, kMostCells));
}

}  // namespace

CompletedCells complete_cells(const BigPly& vertices, const Bounds3d& box, const std::string& folder,
                              const ChunkConfig& chunks, const Progress& progress) {
  ScanSurvey survey;
  survey.ply = vertices;
  survey.moved = survey.shift = float_shift(box);
  survey.box = {static_cast<Vec3f>(box.lo - survey.moved), static_cast<Vec3f>(box.hi - survey.moved)};
  const std::uint64_t cache = memory_limit(chunks.memory) / 4;
  const ScanMap map = map_scan(survey, cache, progress);
  CellPlan plan;
  plan.cells = split_cells(map.grid, choose_cells(vertices, chunks));
  plan.cell_of_box = cells_of_boxes(plan.cells);
  plan.margin = kMarginSpacings * spacing_of(map.grid);
  write_cells(survey, map, plan, folder, cache, progress);
  CompletedCells counts{.cells = static_cast<std::uint32_t>(plan.cells.size())};
  std::size_t done = 0;
  for (const std::size_t i : order_cells(plan.cells)) {
    report(progress, "complete", static_cast<double>(done++) / static_cast<double>(plan.cells.size()));
    LoadedCell cell = load_cell(survey, map.grid, plan, folder, i);
    complete_own(vertices, cell.scan, own_points(folder, i), counts);
    malloc_trim(0);
    std::filesystem::remove(cell_path(folder, i));
  }
  report(progress, "complete", 1);
  return counts;
}

}  // namespace rbvh
