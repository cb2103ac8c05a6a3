// Where to look at an object from: small pictures from around it, and from its axes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "pipeline/base/error.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/render/sensor_view.h"
#include "pipeline/render/small_pictures.h"
#include "rbvh/view.h"

namespace rbvh {
namespace {

struct Turn {
  double azimuth, elevation;  // degrees
};

struct NamedView {
  std::string_view name;
  View view;
  Turn turn;
};

constexpr double kIsoElevation = 35.264389682754654;  // atan(1 / sqrt(2))
constexpr NamedView kNamed[] = {
    {"front", View::kFront, {0, 0}},
    {"back", View::kBack, {180, 0}},
    {"left", View::kLeft, {-90, 0}},
    {"right", View::kRight, {90, 0}},
    {"top", View::kTop, {0, 90}},
    {"bottom", View::kBottom, {0, -90}},
    {"iso", View::kIso, {-45, kIsoElevation}},
    {"best", View::kBest, {}},
    {"sensor", View::kSensor, {}},
};

// The first is the one to be beaten, and by so much.
constexpr std::size_t kViews = 20;
constexpr double kBetter = 1.08;
// What a pixel on an inner silhouette counts, in pixels of surface that faces the camera.
constexpr double kSilhouette = 4;

std::array<Turn, kViews> turns() {
  std::array<Turn, kViews> all{};
  std::size_t count = 0;
  for (const double elevation : {20., 45.})
    for (int i = 0; i < 8; ++i) {
      // From the front on to both sides.
      const int step = (i % 2 == 1 ? 45 : -45) * ((i + 1) / 2);
      all[count++] = {30. + step, elevation};
    }
  for (int i = 0; i < 4; ++i) all[count++] = {30 + 90. * i, 70};
  return all;
}

/// Towards the camera: place_camera()'s, with azimuth and elevation.
Vec3d direction(Turn turn, Vec3d up) {
  const Vec3d front = front_of(up), right = cross(up, front);
  const double a = turn.azimuth * std::numbers::pi / 180, e = turn.elevation * std::numbers::pi / 180;
  return (front * std::cos(a) + right * std::sin(a)) * std::cos(e) + up * std::sin(e);
}

/// How much a picture shows: surface that faces the camera, and where one part of it stands before another.
double shown(const SmallPicture& picture, double diagonal) {
  const std::size_t side = picture.rays.width;
  double area = 0, lines = 0;
  const auto step = [&](const Hit& a, const Hit& b) {
    return std::isfinite(a.t) && std::isfinite(b.t) &&
           std::abs(static_cast<double>(a.t) - static_cast<double>(b.t)) > 0.03 * diagonal;
  };
  for (std::size_t i = 0; i < picture.hits.size(); ++i) {
    const Hit& hit = picture.hits[i];
    if (!std::isfinite(hit.t)) continue;
    if ((hit.flags & RBVH_HIT_BACK_FACE) == 0) area += 1;
    if ((i + 1) % side != 0 && step(hit, picture.hits[i + 1])) lines += 1;
    if (i + side < picture.hits.size() && step(hit, picture.hits[i + side])) lines += 1;
  }
  return area + kSilhouette * lines;
}

std::string angles(Turn turn) {
  char text[64];
  std::snprintf(text, sizeof text, "azimuth %.0f, elevation %.0f", turn.azimuth, turn.elevation);
  return text;
}

ChosenView by_turn(Turn turn, Vec3d up) {
  ChosenView view;
  view.up = up;
  view.words.azimuth = turn.azimuth;
  view.words.elevation = turn.elevation;
  return view;
}

/// The view's words, but for those that are given.
CameraWords with_view(const CameraWords& words, const ChosenView& view) {
  CameraWords all = words;
  const auto fill = [](auto& to, const auto& from) {
    if (!to) to = from;
  };
  fill(all.azimuth, view.words.azimuth);
  fill(all.elevation, view.words.elevation);
  if (!words.focal_point) all.position = view.words.position;  // a sensor's, who looks at the scan
  fill(all.focal_point, view.words.focal_point);
  fill(all.view_up, view.words.view_up);
  fill(all.view_angle, view.words.view_angle);
  return all;
}

std::vector<SmallPicture> pictures_around(const Tracer& tracer, const Asset& asset, Vec3d up) {
  std::vector<SmallPicture> pictures;
  for (const Turn& turn : turns()) pictures.push_back(small_picture(tracer, asset, direction(turn, up), up));
  return pictures;
}

}  // namespace

std::optional<View> find_view(std::string_view name) {
  for (const NamedView& named : kNamed)
    if (named.name == name) return named.view;
  return std::nullopt;
}

ChosenView choose_view(const Tracer& tracer, const Asset& asset, View view, std::optional<Vec3d> up,
                       double aspect) {
  for (const NamedView& named : kNamed)
    if (named.view == view && view != View::kBest && view != View::kSensor) {
      ChosenView chosen = by_turn(named.turn, up.value_or(asset.up_axis()));
      chosen.text = std::string(named.name);
      return chosen;
    }
  std::string up_text;
  const Vec3d above = up ? *up : find_up(tracer, asset, up_text);
  const std::vector<SmallPicture> pictures = pictures_around(tracer, asset, above);
  if (view != View::kBest) {
    if (auto seen = sensor_view(tracer, asset, pictures, up, aspect)) return *seen;
    if (view == View::kSensor)
      throw Error(ErrorKind::kUsage, asset.path,
                  "was not seen from one place, or it is not known from where");
  }
  std::size_t best = 0;
  double most = 0;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const double score = shown(pictures[i], static_cast<double>(asset.bounds.diagonal()));
    if (i > 0 && !(score > kBetter * most)) continue;
    best = i;
    most = score;
  }
  ChosenView chosen = by_turn(turns()[best], above);
  chosen.text = "best of " + std::to_string(kViews) + " views: " + angles(turns()[best]) + up_text;
  return chosen;
}

PlacedCameras place_cameras(const Tracer& tracer, const Asset& asset, const CameraRequest& request) {
  PlacedCameras placed;
  placed.up = request.up.value_or(asset.up_axis());
  const auto wants_view = [&](const CameraWords& words) {
    const bool is_open = !words.position && !words.azimuth && !words.elevation;
    return request.view == View::kChosen ? is_open : !words.position;
  };
  std::optional<ChosenView> chosen;
  if (std::any_of(request.words.begin(), request.words.end(), wants_view)) {
    chosen = choose_view(tracer, asset, request.view, request.up, request.aspect);
    placed.up = chosen->up;
    placed.text = chosen->text;
  }
  const Bounds3d box = to_double(asset.bounds);
  for (const CameraWords& given : request.words) {
    CameraWords words = less_shift(given, request.shift);
    const Vec3d axis = words.view_up.value_or(placed.up);
    if (chosen && wants_view(words)) words = with_view(words, *chosen);
    const Camera camera = place_camera(words, box, placed.up, request.aspect);
    if (request.turns <= 0) placed.cameras.push_back(camera);
    for (const Camera& turned : turntable(camera, axis, request.turns)) placed.cameras.push_back(turned);
  }
  return placed;
}

}  // namespace rbvh
