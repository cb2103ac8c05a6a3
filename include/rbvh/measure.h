// How far a pair's levels are from the exact scan: in what rays see, in pictures, and between the surfaces.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/camera.h"
#include "rbvh/device.h"
#include "rbvh/memory_budget.h"
#include "rbvh/progress.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// Middle and tail of a set of errors, by nearest rank. All NaN for an empty set.
struct Distribution {
  double median = 0, p95 = 0, p99 = 0, p999 = 0, max = 0;
};
/// One view, or all views together (counts added up, distributions over all pixels).
struct HitFidelity {
  std::uint64_t pixels = 0;  ///< that the exact tracer hits
  std::uint64_t holes = 0, leaks = 0, walls = 0;
  std::uint64_t mismatches = 0;     ///< pixels where one of the two hits
  std::uint64_t at_silhouette = 0;  ///< of these, within 1 pixel of the exact silhouette
  Distribution dt;                  ///< |t difference| / diagonal where both hit
  Distribution normal_degrees;      ///< angle between the geometric normals where both hit

  double mismatch_percent() const {
    return pixels ? 100.0 * static_cast<double>(mismatches) / static_cast<double>(pixels) : 0;
  }
  double silhouette_percent() const {
    return mismatches ? 100.0 * static_cast<double>(at_silhouette) / static_cast<double>(mismatches) : 0;
  }
};

struct ViewsConfig {
  int views = 8;
  std::uint32_t resolution = 1024;  ///< both ways
  Vec3d up_axis{0, 1, 0};
};

/// A view of one level as measure_views() hands it on, for pictures.
struct MeasuredView {
  std::size_t level;
  int view;
  const Camera& camera;
  const CameraRays& rays;
  std::span<const Hit> exact, hits;
  const HitFidelity& fidelity;
};

struct ViewsFidelity {
  std::vector<HitFidelity> views;
  HitFidelity all;
  std::uint64_t worst_holes = 0, worst_leaks = 0, worst_walls = 0;  ///< of one view
};

struct ImageError {
  double rmse = 0;  ///< of the sRGB values in [0, 1]
  double psnr = 0;  ///< decibels; +infinity for equal pictures
  double ssim = 1;  ///< of the grey values, Gaussian windows of 11 pixels; at most 1
};

struct DistanceStatistics {
  double rms = 0, max = 0;  ///< scan units
};

struct MeasureConfig {
  ViewsConfig views;                                   ///< but for the up axis, which is the scan's
  bool images = false;                                 ///< also how different the shaded pictures are
  bool distances = false;                              ///< also the distance between the surfaces
  std::function<void(const MeasuredView&)> on_view{};  ///< sees each view of each level, for pictures
  MemoryBudget memory;
};

struct LevelMeasure {
  std::string level;
  ViewsFidelity views;
  ImageError image;    ///< mean over the views
  ImageError control;  ///< the same between two exact pictures, one with its rays a quarter pixel aside
  DistanceStatistics to_scan, to_level;  ///< from points on the level, from points on the scan; scan units
  double diagonal = 0;                   ///< of the scan, scan units
  double texel = 0;                      ///< mean side, scan units
};

/// In words, where `exact` does not lie where the scan that the pair was built of did; else nothing.
std::optional<std::string> find_other_scan(const Asset& pair, const Asset& exact);

/// `levels` as of choose_levels(pair). Both assets are in the same coordinates. Throws Error(kBudget).
std::vector<LevelMeasure> measure_levels(const Device& device, const Asset& pair, const Asset& exact,
                                         const std::vector<std::string>& levels, const MeasureConfig& config,
                                         const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
