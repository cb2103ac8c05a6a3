#include "cli/camera_options.h"

#include <spdlog/fmt/fmt.h>

#include <nlohmann/json.hpp>

#include "cli/common.h"
#include "io/input_file.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

constexpr const char* kGroup = "Camera (as f3d's)";

[[noreturn]] void refuse(const std::string& path, const std::string& where, const std::string& what) {
  throw Error(ExitCode::kInput, path, where + ": " + what);
}

double read_number(const std::string& path, const std::string& where, const Json& value) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) refuse(path, where, "a number is wanted");
  return value.get<double>();
}

Vec3d read_vec3(const std::string& path, const std::string& where, const Json& value) {
  if (!value.is_array() || value.size() != 3) refuse(path, where, "three numbers [x, y, z] are wanted");
  return {read_number(path, where, value[0]), read_number(path, where, value[1]),
          read_number(path, where, value[2])};
}

CameraWords read_camera(const std::string& path, const std::string& where, const Json& value,
                        CameraWords words) {
  if (!value.is_object()) refuse(path, where, "an object is wanted");
  for (const auto& [key, entry] : value.items()) {
    const std::string at = fmt::format("{}, {}", where, key);
    if (key == "position")
      words.position = read_vec3(path, at, entry);
    else if (key == "focal_point")
      words.focal_point = read_vec3(path, at, entry);
    else if (key == "view_up")
      words.view_up = read_vec3(path, at, entry);
    else if (key == "view_angle")
      words.view_angle = read_number(path, at, entry);
    else if (key == "azimuth_angle")
      words.azimuth = read_number(path, at, entry);
    else if (key == "elevation_angle")
      words.elevation = read_number(path, at, entry);
    else
      refuse(path, at,
             "is no camera word; there are position, focal_point, view_up, view_angle, azimuth_angle, "
             "elevation_angle");
  }
  return words;
}

}  // namespace

void add_camera_options(CLI::App& stage, CameraOptions& options) {
  const auto add = [&stage](const char* name, auto& target, auto parse, const char* value, const char* help) {
    add_parsed(stage, name, target, parse, value, help)->group(kGroup);
  };
  CameraWords& words = options.words;
  add("--resolution", options.resolution, parse_resolution, "W,H", "pixels (default: 1024,1024)");
  add("--camera-position", words.position, parse_vec3, "X,Y,Z",
      "default: the whole object in a three-quarter view");
  add("--camera-focal-point", words.focal_point, parse_vec3, "X,Y,Z",
      "what is looked at (default: the object's middle)");
  add("--camera-view-up", words.view_up, parse_vec3, "X,Y,Z", "what is up in the picture (default: --up)");
  add("--camera-view-angle", words.view_angle, parse_number, "DEG", "vertical, full angle (default: 30)");
  add("--camera-azimuth-angle", words.azimuth, parse_number, "DEG",
      "turn to the right about the focal point");
  add("--camera-elevation-angle", words.elevation, parse_number, "DEG", "turn upwards about the focal point");
  add("--up", options.up, parse_axis, "AXIS", "default: +Y for meshes, +Z for clouds");
  add("--turntable", options.turntable, parse_positive, "N",
      "N pictures around the up axis; name them with {frame:03}");
  stage.add_option("--cameras", options.cameras_path, "a JSON list of cameras, one picture each")
      ->type_name("FILE")
      ->group(kGroup);
}

std::vector<CameraWords> read_cameras(const std::string& path, const CameraWords& defaults) {
  const InputBytes bytes = read_input(path);
  Json json;
  try {
    json = Json::parse(bytes.view());
  } catch (const Json::parse_error& error) {
    refuse(path, "byte " + std::to_string(error.byte), "this is no JSON");
  }
  if (json.is_object() && json.size() == 1 && json.contains("cameras")) json = Json(json["cameras"]);
  if (!json.is_array() || json.empty())
    throw Error(ExitCode::kInput, path, "a list of one camera or more is wanted");
  std::vector<CameraWords> cameras;
  for (const Json& value : json)
    cameras.push_back(read_camera(path, "camera " + std::to_string(cameras.size()), value, defaults));
  return cameras;
}

std::vector<Camera> place_cameras(const CameraOptions& options, const std::vector<CameraWords>& words,
                                  const Bounds3f& bounds, Vec3d default_up) {
  const Bounds3d box{static_cast<Vec3d>(bounds.lo), static_cast<Vec3d>(bounds.hi)};
  const Vec3d up = options.up.value_or(default_up);
  const double aspect = static_cast<double>(options.resolution.width) / options.resolution.height;
  std::vector<Camera> cameras;
  for (const CameraWords& w : words) {
    const Camera camera = place_camera(w, box, up, aspect);
    if (options.turntable == 0) {
      cameras.push_back(camera);
      continue;
    }
    for (const Camera& turned : turntable(camera, w.view_up.value_or(up), options.turntable))
      cameras.push_back(turned);
  }
  return cameras;
}

}  // namespace rbvh
