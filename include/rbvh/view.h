// Where to look at an object from, where nobody says: at its sensor, or where most is seen of it.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rbvh/asset.h"
#include "rbvh/camera.h"
#include "rbvh/tracer.h"

#pragma GCC visibility push(default)
namespace rbvh {

enum class View {
  kChosen,  ///< the sensor's of a cloud that was seen from one place; else the best
  kFront,
  kBack,
  kLeft,
  kRight,
  kTop,
  kBottom,
  kIso,
  kBest,
  kSensor,
};

/// "front", "back" ..., or nothing for any other word.
std::optional<View> find_view(std::string_view name);

struct ChosenView {
  CameraWords words;  ///< of a camera that nobody placed, in inner coordinates
  Vec3d up{0, 1, 0};  ///< what is up: what was asked for, or what the scan says
  std::string text;   ///< what was chosen and why, such as "best of 20 views: azimuth 30, elevation 20"
};

/// Casts some hundred thousand rays, for kChosen, kBest and kSensor. `up`: unless given, the asset's own, or
/// where the surface says otherwise, that of its largest level plane. `aspect` is width / height. Throws
/// Error(kUsage) for kSensor where the asset was not seen from one place.
ChosenView choose_view(const Tracer& tracer, const Asset& asset, View view, std::optional<Vec3d> up,
                       double aspect);

/// Cameras as a user says them.
struct CameraRequest {
  std::vector<CameraWords> words{{}};  ///< in the file's coordinates, less `shift`
  int turns = 0;                       ///< above 0: a turntable of so many cameras from each
  View view = View::kChosen;           ///< of cameras without a position
  std::optional<Vec3d> up{};
  double aspect = 1;  ///< width / height
  Vec3d shift{};      ///< to inner coordinates
};

struct PlacedCameras {
  std::vector<Camera> cameras;  ///< in inner coordinates
  Vec3d up{0, 1, 0};
  std::string text;  ///< ChosenView's; empty: all that matters was given
};

/// place_camera() for each of the words. Where they say neither a position nor angles, or the view is not
/// kChosen, what they leave open is choose_view()'s.
PlacedCameras place_cameras(const Tracer& tracer, const Asset& asset, const CameraRequest& request);

}  // namespace rbvh
#pragma GCC visibility pop
