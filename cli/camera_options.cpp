#include "cli/camera_options.h"

#include "cli/common.h"

namespace rbvh {
namespace {

constexpr const char* kGroup = "Camera (as f3d's)";

/// All pictures' cameras are made before the first picture is.
int parse_turns(std::string_view text) { return parse_integer_between(text, 1, 100000); }

}  // namespace

void add_camera_options(CLI::App& stage, CameraOptions& options) {
  const auto add = [&stage](const char* name, auto& target, auto parse, const char* value, const char* help) {
    add_parsed(stage, name, target, parse, value, help)->group(kGroup);
  };
  CameraWords& words = options.given;
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
  add("--turntable", options.turns, parse_turns, "N",
      "N pictures around the up axis; name them with {frame:03}");
  stage.add_option("--cameras", options.cameras_path, "a JSON list of cameras, one picture each")
      ->type_name("FILE")
      ->group(kGroup);
}

}  // namespace rbvh
