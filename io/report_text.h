// Results in words and tables, for people to read.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/device/device.h"
#include "pipeline/proxy/bake.h"
#include "pipeline/proxy/import_vdm.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scan/ingest.h"
#include "rbvh/mesh.h"
#include "rbvh/update.h"

namespace rbvh {

/// "0  cpu  its name  (its platform, 2 units, 8 GB)".
std::string device_line(const DeviceInfo& info);

/// A line for each traversal of exact hierarchies: its name, what it is, the builders that fit it.
std::string exact_methods_text();

/// "FILE: whole (2 levels, ...)": of CheckedFile.summary.
std::string file_line(const nlohmann::ordered_json& summary);

/// Of a list of measure_json(): a line for each figure, a column for each level.
std::string fidelity_table(const nlohmann::ordered_json& levels);

/// Of proxy_measure_json(): a line each way.
std::string distance_text(const nlohmann::ordered_json& distance);

/// "Q3 2.1e-4 (asked for: 1e-4)".
std::string missed_error(const std::string& level, float asked, float reached);

/// The same of those of the levels that missed the error that they were built for, with commas between;
/// levels of tiles and of clouds may.
template <class Levels>
std::string missed_errors(const Levels& levels) {
  std::string missed;
  for (const auto& level : levels)
    if (level.reached > level.error)
      missed += (missed.empty() ? "" : ", ") + missed_error(level.name, level.error, level.reached);
  return missed;
}

/// "1.25 times as large as dragon.ply (30 MB)".
std::string larger_than_text(std::uint64_t bytes, std::uint64_t others, const std::string& other);

/// What became of a level's tiles; empty where it has none.
std::string joined_tiles_text(const LevelMeshCounts& counts);

/// "30 vertices, 56 triangles; 0 open edges, 0 non-manifold", or "30 points".
std::string mesh_text(const Scan& mesh, const LevelMeshCounts& counts);

/// What a bake left out and cut: a line for each that is not zero.
std::vector<std::string> manifold_lines(const ManifoldCounts& counts);

/// "3000 patches, 1000 texels, 1.2 MB; RMS distance 0.01% to the scan, 0.01% back"; `distance`: of
/// proxy_measure_json(), `bytes`: of the proxy's files.
std::string bake_text(const BakeReport& counts, std::uint64_t bytes, const nlohmann::ordered_json& distance);

/// What an update could not keep, and how much of the surface and of the leaves went and came: a line each.
std::vector<std::string> update_lines(const UpdateReport& report);

/// What was wrong with another program's asset: a line for each count that is not zero.
std::vector<std::string> import_warnings(const ImportReport& counts);

/// "3000 patches, 1000 texels, 1.2 MB; 5 seams welded".
std::string import_text(const ImportReport& counts, std::uint64_t bytes);

/// What is left, what was removed, what was estimated and by how much positions were shifted: one to four
/// lines, of the counts that are not zero. `output` names what was written.
std::vector<std::string> ingest_lines(const std::string& output, const IngestReport& counts,
                                      const Scan& scan);

}  // namespace rbvh
