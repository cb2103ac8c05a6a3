#include "chunks/cell_files.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "io/output_file.h"

namespace rbvh {
namespace {

constexpr std::size_t kBuffered = 1 << 14;  // records of a cell

/// The file of a cell.
class RecordFile {
 public:
  explicit RecordFile(const std::string& path) : file_(path, true) { buffer_.reserve(kBuffered); }
  void add(const CellRecord& record) {
    buffer_.push_back(record);
    if (buffer_.size() == kBuffered) flush();
  }
  void commit() {
    flush();
    file_.commit();
  }

 private:
  void flush() {
    file_.write(std::as_bytes(std::span<const CellRecord>(buffer_)));
    buffer_.clear();
  }
  OutputFile file_;
  std::vector<CellRecord> buffer_;
};

bool meet(const std::array<int, 3>& lo, const std::array<int, 3>& hi, const Cell& cell) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (hi[axis] < cell.lo[axis] || lo[axis] >= cell.hi[axis]) return false;
  return true;
}

bool lies_in(const std::array<int, 3>& lo, const std::array<int, 3>& hi, const Cell& cell) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (lo[axis] < cell.lo[axis] || hi[axis] >= cell.hi[axis]) return false;
  return true;
}

}  // namespace

std::string cell_path(const std::string& folder, std::size_t cell) {
  char name[40];
  std::snprintf(name, sizeof name, "cell-%04zu.records", cell);
  return (std::filesystem::path(folder) / name).string();
}

std::vector<CellCounts> write_cells(const ScanSurvey& survey, const ScanMap& map, const CellPlan& plan,
                                    const std::string& folder, std::uint64_t cache_bytes,
                                    const Progress& progress) {
  std::vector<CellCounts> counts(plan.cells.size());
  std::vector<std::unique_ptr<RecordFile>> files;
  for (std::size_t i = 0; i < plan.cells.size(); ++i)
    files.push_back(std::make_unique<RecordFile>(cell_path(folder, i)));
  for_each_primitive(
      survey, cache_bytes,
      [&](const PassedPrimitive& primitive) {
        const std::uint16_t own = plan.cell_of_box[SpaceGrid::index(map.grid.place(primitive.center))];
        CellRecord record{primitive.corners, primitive.object_id, 1};
        files[own]->add(record);
        ++counts[own].own;
        counts[own].area += primitive.area;
        const float reach = plan.margin + (std::isfinite(primitive.radius) ? primitive.radius : 0);
        const Vec3f margin{reach, reach, reach};
        const std::array<int, 3> lo = map.grid.place(primitive.box.lo - margin),
                                 hi = map.grid.place(primitive.box.hi + margin);
        if (lies_in(lo, hi, plan.cells[own])) return;
        record.is_own = 0;
        for (std::size_t i = 0; i < plan.cells.size(); ++i) {
          if (i == own || !meet(lo, hi, plan.cells[i])) continue;
          files[i]->add(record);
          ++counts[i].near;
        }
      },
      [&](double fraction) { report(progress, "sort", fraction); });
  for (const auto& file : files) file->commit();
  return counts;
}

}  // namespace rbvh
