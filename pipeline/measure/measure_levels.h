// Measures a pair's levels, or a proxy, against the exact scan: what `validate --against` prints and
// `build --measure` stores.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/memory_budget.h"
#include "pipeline/base/progress.h"
#include "pipeline/device/device.h"
#include "pipeline/measure/fidelity.h"
#include "pipeline/measure/image_error.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/proxy/proxy.h"
#include "pipeline/scene/asset.h"

namespace rbvh {

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

/// What a pair's file keeps of it. Wants images and distances to have been measured.
LevelFidelity stored_fidelity(const LevelMeasure& measure, const ViewsConfig& views);

/// Measures these levels with pictures and distances, and stores what is found in the pair. Throws as
/// measure_levels().
void measure_and_store(const Device& device, Asset& pair, const Asset& exact,
                       const std::vector<std::string>& levels, const ViewsConfig& views,
                       const MemoryBudget& memory = {}, const Progress& progress = {});

/// The larger of the two surface distances' RMS, in % of the diagonal: what a level is chosen by. NaN
/// where it was not measured.
double error_percent(const LevelFidelity& fidelity);

/// A figure that is worse than the file says, in words ("3 holes, where the file says 0"), or nothing: beyond
/// what another device's rounding could explain. Both measured, with the same views.
std::string find_difference(const LevelFidelity& stored, const LevelFidelity& found);

/// A proxy's distance to the scan, both ways.
struct ProxyMeasure {
  DistanceStatistics to_scan, to_proxy;  ///< scan units
  double diagonal = 0;                   ///< of the scan
};
ProxyMeasure measure_proxy(const Proxy& proxy, const Scan& scan);

}  // namespace rbvh
