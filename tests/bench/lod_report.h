// What was measured of levels and their twins, and how it is written down: a Markdown table, JSON.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rbvh/measure.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/twin.h"

namespace rbvh::bench {

/// Of a level or a twin.
struct LodFigures {
  ViewsFidelity views;
  std::optional<double> to_scan_rms, from_scan_rms;  ///< distances of the surfaces, in diagonals
  std::size_t disk_bytes = 0, memory_bytes = 0;
  std::optional<RaysResult> primary, diffuse;  ///< a twin's: Embree's best
  std::optional<double> build_s;               ///< from the scan until it can be ray cast
};

struct TwinFigures : LodFigures {
  std::size_t triangles = 0, vertices = 0;
  int trials = 0;
  MeshBytes stored;
  std::optional<double> decimate_s;  ///< of build_s
};

struct LodResult {
  std::string scan, level;
  std::size_t scan_triangles = 0;
  LodFigures figures;
  std::optional<TwinFigures> twin;                         ///< of meshes
  std::optional<double> primary_of_twin, diffuse_of_twin;  ///< rate over the twin's: medians of ratios
};

std::string markdown(const std::vector<LodResult>& results);
/// A list, one object a level.
std::string json(const std::vector<LodResult>& results);

}  // namespace rbvh::bench
