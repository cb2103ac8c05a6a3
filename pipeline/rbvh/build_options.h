// What a build is asked for: its choices in words, and the record of them that the pair keeps.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/rbvh/build.h"

namespace rbvh {

inline constexpr std::pair<std::string_view, Refinement> kRefinements[] = {
    {"area", Refinement::kProjectedArea}, {"cone", Refinement::kConeOfNormals}};
inline constexpr std::pair<std::string_view, SplitRule> kSplitRules[] = {
    {"median", SplitRule::kSpatialMedian}, {"sah", SplitRule::kSurfaceArea}};
inline constexpr std::pair<std::string_view, PartitionWhere> kPartitionPlaces[] = {
    {"device", PartitionWhere::kDevice}, {"host", PartitionWhere::kHost}};
inline constexpr std::pair<std::string_view, RaysKind> kRayKinds[] = {{"coherent", RaysKind::kCoherent},
                                                                      {"incoherent", RaysKind::kIncoherent}};
inline constexpr std::pair<std::string_view, Hybrid> kHybrids[] = {
    {"off", Hybrid::kOff}, {"auto", Hybrid::kAuto}, {"always", Hybrid::kAlways}};

/// "Q0=1e-5,Q2": levels, some with errors, in parts of the diagonal. Throws Error(kUsage).
std::vector<WantedLevel> parse_wanted_levels(std::string_view text);

/// Layers made of the scan's vertex properties.
struct LayerWords {
  std::vector<std::string> names;
  double scale = 1;  ///< their texels to one of the heights'
};

/// The JSON object that Rbvh.build_options holds.
std::string build_options_json(const BuildConfig& config, const std::optional<FocusWords>& focus = {},
                               const LayerWords& layers = {});

/// What such an object tells of how a build was configured: all but the levels. Words that are not known are
/// passed over, but for a camera's focus without a radius, which asks for the scan: `lacks_focus`. `shift`:
/// of the pair.
BuildConfig stored_config(const std::string& options, const Vec3d& shift, bool& lacks_focus);

/// The options, with a count of updates that is one more.
std::string count_update(const std::string& options);

}  // namespace rbvh
