// Measures a pair's levels against the exact scan: what `validate --against` prints and `build --measure`
// stores.
#pragma once

#include <string>
#include <vector>

#include "cli/subject.h"
#include "pipeline/measure/fidelity.h"
#include "pipeline/measure/image_error.h"
#include "pipeline/measure/surface_distance.h"
#include "pipeline/proxy/proxy.h"

namespace rbvh {

struct MeasureConfig {
  ViewsConfig views;
  bool images = false;     ///< also how different the shaded pictures are
  bool distances = false;  ///< also the distance between the surfaces
  std::string pictures;    ///< a folder for difference pictures <level>-<view>.png; empty: none
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

/// --views and --resolution, which go with the option named `with`.
void add_views_options(CLI::App& stage, ViewsConfig& views, const std::string& with);

/// Into the pair's coordinates, where the scan was read with another shift: an ingested scan's own may differ
/// from that of the file it came from.
void move_to_shift(Scan& scan, const Vec3d& shift);

/// The scan that `pair` is to be measured against, in its coordinates.
Subject load_against(Context& context, const Subject& pair, const std::string& path);

/// In words, where such a scan does not lie where the one that the pair was built of did; else nothing.
std::optional<std::string> find_other_scan(const Subject& pair, const Subject& exact);

/// `levels` as of choose_levels(pair). Both subjects are in the same coordinates.
std::vector<LevelMeasure> measure_levels(Context& context, const Device& device, const Subject& pair,
                                         const Subject& exact, const std::vector<std::string>& levels,
                                         const MeasureConfig& config);

/// What a pair's file keeps of it. Wants images and distances to have been measured.
LevelFidelity stored_fidelity(const LevelMeasure& measure, const ViewsConfig& views);

/// As reports and `--json` have it.
nlohmann::ordered_json fidelity_json(const LevelFidelity& fidelity);

/// The larger of the two surface distances' RMS, in % of the diagonal: what `lod --max-error` means. NaN
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

/// {"proxy_to_scan": {"rms_percent", "max_percent"}, "scan_to_proxy": ...}, in percent of the diagonal.
nlohmann::ordered_json proxy_measure_json(const ProxyMeasure& measure);

}  // namespace rbvh
