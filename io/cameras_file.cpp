#include "io/cameras_file.h"

#include <cmath>

#include "io/input_file.h"
#include "io/shallow_json.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

using Json = nlohmann::json;

constexpr int kMostDepth = 8;

[[noreturn]] void refuse(const std::string& path, const std::string& where, const std::string& what) {
  std::string line = where + ": " + what;
  for (char& c : line)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';  // words out of the file go to terminals
  throw Error(ErrorKind::kInput, path, line);
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
    const std::string at = std::string(where).append(", ").append(key);
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

std::vector<CameraWords> decode_cameras(std::string_view text, const std::string& path,
                                        const CameraWords& defaults) {
  std::size_t byte = 0;
  Json json = parse_shallow_json(text, kMostDepth, &byte);
  if (json.is_discarded())
    throw Error(ErrorKind::kInput, path, FilePlace{"byte", byte}, "this is no JSON, or nests too deep");
  if (json.is_object() && json.size() == 1 && json.contains("cameras")) json = Json(json["cameras"]);
  if (!json.is_array() || json.empty())
    throw Error(ErrorKind::kInput, path, "a list of one camera or more is wanted");
  std::vector<CameraWords> cameras;
  for (const Json& value : json)
    cameras.push_back(read_camera(path, "camera " + std::to_string(cameras.size()), value, defaults));
  return cameras;
}

std::vector<CameraWords> read_cameras(const std::string& path, const CameraWords& defaults) {
  return decode_cameras(read_input(path).view(), path, defaults);
}

}  // namespace rbvh
