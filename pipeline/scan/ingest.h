// What the stage `ingest` does between reading and writing: narrow to float, clean, complete.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "pipeline/scan/clean.h"
#include "pipeline/scan/complete_cloud.h"
#include "pipeline/scan/components.h"
#include "pipeline/scan/winding.h"
#include "rbvh/progress.h"
#include "rbvh/scan.h"

namespace rbvh {

struct Outliers {
  std::size_t neighbors = 16;
  double sigma = 2;
};

/// By default nothing visible is changed.
struct IngestConfig {
  std::optional<Outliers> outliers = std::nullopt;  ///< remove them
  double voxel = 0;            ///< > 0: thin a cloud to one point a voxel of this side, scan units
  double min_component = 0;    ///< > 0: remove components with less than this fraction of all faces (points)
  std::size_t normals_k = 16;  ///< neighbours from which a cloud's normals and radii are estimated
  bool recompute_normals = false;                 ///< of a cloud, also where the file has them
  bool remove_far = false;                        ///< points far from all others; see count_far()
  bool orient = false;                            ///< turn a mesh's faces so that neighbours agree
  bool flip_normals = false;                      ///< reverse all normals, and the winding of a mesh's faces
  std::optional<Vec3d> viewpoint = std::nullopt;  ///< where the sensor stood, in the coordinates of the input
};

/// Counts of elements read, removed and added.
struct IngestReport {
  std::size_t vertices_in = 0, faces_in = 0;
  CleanCounts cleaned;
  std::size_t far = 0, outliers = 0, thinned = 0;
  WindingCounts winding;
  ComponentCounts small_components;
  CloudCounts cloud;
  std::size_t mesh_normals_completed = 0;
  std::size_t vertices_out = 0, faces_out = 0, objects = 0;
  double area = 0;  ///< scan units squared
};

/// About how many bytes ingest() holds at once.
std::uint64_t ingest_memory(const RawScan& scan);

/// `file` is for messages. Throws Error(kInput) when nothing finite, no face with an area or no extent is
/// left, and Error(kUsage) for what cannot be done to a mesh.
Scan ingest(RawScan&& raw, const std::string& file, const IngestConfig& config, IngestReport& counts,
            const Progress& progress = {});

/// Throws Error(kInput) when the scan has no finite position or all of them are equal. Every stage that takes
/// scans calls this.
void check_usable(const Scan& scan, const std::string& file);

}  // namespace rbvh
