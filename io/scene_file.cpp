#include "io/scene_file.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "io/input_file.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::size_t kMostDepth = 64;       // of nested groups, and of JSON
constexpr double kLeastDeterminant = 1e-12;  // of a transform, over its rows' lengths
constexpr double kLargest = 1e18;            // coordinate

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), folder_(fs::path(path).parent_path()) {}

  SceneFile read(std::string_view text) {
    const Json root = parse(text);
    if (!root.is_object()) refuse("", "is no JSON object");
    check_words(root, "", {"rbvh_scene", "$schema", "up", "objects", "instances"});
    if (!root.contains("rbvh_scene") || !root["rbvh_scene"].is_number_integer())
      refuse("", "does not say \"rbvh_scene\": 1; is it a scene?");
    if (root["rbvh_scene"] != 1)
      refuse("rbvh_scene", "is version " + root["rbvh_scene"].dump() + ", and this program reads version 1");
    if (root.contains("up")) {
      const std::string up = text_of(root["up"], "up");
      if (up != "+Y" && up != "+Z") refuse("up", "is neither \"+Y\" nor \"+Z\"");
      scene_.z_is_up = up == "+Z";
    }
    read_objects(root);
    if (!root.contains("instances")) refuse("", "has no \"instances\"");
    for (const auto& [name, list] : groups_) check_group(name);
    check_list(root["instances"], "instances");
    place(root["instances"], "instances", Affine{});
    if (scene_.instances.empty()) refuse("instances", "places nothing");
    return std::move(scene_);
  }

 private:
  [[noreturn]] void refuse(const std::string& where, const std::string& what) const {
    std::string line = where.empty() ? what : where + " " + what;
    for (char& c : line)
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';  // names go to terminals
    if (line.size() > 400) line.resize(400);
    throw Error(ErrorKind::kInput, path_, line);
  }

  Json parse(std::string_view text) const {
    std::vector<std::set<std::string>> keys;
    const auto watch = [&](int depth, Json::parse_event_t event, Json& value) {
      if (static_cast<std::size_t>(depth) > kMostDepth)
        refuse("", "nests more than " + std::to_string(kMostDepth) + " deep");
      if (event == Json::parse_event_t::object_start) keys.emplace_back();
      if (event == Json::parse_event_t::object_end && !keys.empty()) keys.pop_back();
      if (event == Json::parse_event_t::key && !keys.empty() &&
          !keys.back().insert(value.get<std::string>()).second)
        refuse("", "has \"" + value.get<std::string>() + "\" twice in one place");
      return true;
    };
    try {
      return Json::parse(text.begin(), text.end(), watch);
    } catch (const Json::exception& error) {
      refuse("", std::string("is no JSON: ") + error.what());
    }
  }

  void check_words(const Json& json, const std::string& where, const std::set<std::string>& known) const {
    for (const auto& [key, value] : json.items()) {
      if (known.contains(key)) continue;
      std::string list;
      for (const std::string& word : known) list += (list.empty() ? "" : ", ") + word;
      refuse(where, "has the unknown word \"" + key + "\"; there are " + list);
    }
  }

  std::string text_of(const Json& json, const std::string& where) const {
    if (!json.is_string() || json.get_ref<const std::string&>().empty()) refuse(where, "is no text");
    return json.get<std::string>();
  }

  double number_of(const Json& json, const std::string& where) const {
    const double value = json.is_number() ? json.get<double>() : std::nan("");
    if (!(std::abs(value) <= kLargest)) refuse(where, "is no number that makes sense");
    return value;
  }

  std::vector<double> numbers_of(const Json& json, const std::string& where, std::size_t count) const {
    if (!json.is_array() || json.size() != count)
      refuse(where, "is not " + std::to_string(count) + " numbers");
    std::vector<double> values;
    for (const Json& value : json) values.push_back(number_of(value, where));
    return values;
  }

  void read_objects(const Json& root) {
    if (!root.contains("objects") || !root["objects"].is_object()) refuse("", "has no \"objects\"");
    for (const auto& [name, object] : root["objects"].items()) {
      const std::string where = "object \"" + name + "\"";
      if (!object.is_object()) refuse(where, "is no JSON object");
      check_words(object, where, {"file", "level", "group"});
      if (object.contains("file") == object.contains("group"))
        refuse(where, "wants either \"file\" or \"group\"");
      if (object.contains("group")) {
        if (object.contains("level")) refuse(where, "is a group: \"level\" is for the files in it");
        groups_[name] = &groups_json_.emplace_back(object["group"]);
        continue;
      }
      const fs::path file = text_of(object["file"], where + ": \"file\"");
      if (is_scene(file.string())) refuse(where, "is a scene within the scene; write it as a group");
      SceneFile::Object read;
      read.name = name;
      read.path = (file.is_absolute() ? file : folder_ / file).string();
      if (object.contains("level")) read.level = text_of(object["level"], where + ": \"level\"");
      files_[name] = scene_.objects.size();
      scene_.objects.push_back(std::move(read));
    }
  }

  Affine transform_of(const Json& json, const std::string& where) const {
    Affine a;
    if (json.contains("matrix")) {
      for (const char* other : {"translate", "rotate", "scale"})
        if (json.contains(other)) refuse(where, std::string("has both \"matrix\" and \"") + other + "\"");
      const Json& matrix = json["matrix"];
      const bool whole = matrix.is_array() && matrix.size() == 16;
      const std::vector<double> values = numbers_of(matrix, where + ": \"matrix\"", whole ? 16 : 12);
      if (whole && (values[12] != 0 || values[13] != 0 || values[14] != 0 || values[15] != 1))
        refuse(where, "has a \"matrix\" whose last row is not 0 0 0 1");
      std::copy_n(values.begin(), 12, a.m.begin());
    }
    if (json.contains("scale")) {
      const Json& scale = json["scale"];
      const std::string what = where + ": \"scale\"";
      std::vector<double> s(3, 1);
      if (scale.is_array())
        s = numbers_of(scale, what, 3);
      else
        std::fill(s.begin(), s.end(), number_of(scale, what));
      for (std::size_t axis = 0; axis < 3; ++axis) a.m[5 * axis] = s[axis];
    }
    if (json.contains("rotate")) {
      const Json& rotate = json["rotate"];
      const std::string what = where + ": \"rotate\"";
      if (!rotate.is_object()) refuse(what, "wants \"axis\" and \"degrees\"");
      check_words(rotate, what, {"axis", "degrees"});
      if (!rotate.contains("axis") || !rotate.contains("degrees"))
        refuse(what, "wants \"axis\" and \"degrees\"");
      const std::vector<double> v = numbers_of(rotate["axis"], what, 3);
      const Vec3d axis = normalized(Vec3d{v[0], v[1], v[2]});
      if (!(length(axis) > 0.5)) refuse(what, "has an axis without direction");
      a = rotation(axis, number_of(rotate["degrees"], what)) * a;
    }
    if (json.contains("translate")) {
      const std::vector<double> v = numbers_of(json["translate"], where + ": \"translate\"", 3);
      for (std::size_t axis = 0; axis < 3; ++axis) a.m[4 * axis + 3] += v[axis];
    }
    check_transform(a, where);
    return a;
  }

  static Affine rotation(const Vec3d& axis, double degrees) {
    // Multiples of 90 degrees are exact.
    const double angle = std::fmod(degrees, 360.0), radians = angle * std::numbers::pi / 180;
    double c = std::cos(radians), s = std::sin(radians);
    if (std::fmod(angle, 90.0) == 0) {
      c = std::round(c);
      s = std::round(s);
    }
    const double x = axis.x, y = axis.y, z = axis.z, d = 1 - c;
    Affine a;
    a.m = {c + x * x * d,     x * y * d - z * s, x * z * d + y * s, 0,
           y * x * d + z * s, c + y * y * d,     y * z * d - x * s, 0,
           z * x * d - y * s, z * y * d + x * s, c + z * z * d,     0};
    return a;
  }

  void check_transform(const Affine& a, const std::string& where) const {
    double rows = 1;
    bool sane = a.is_finite();
    for (std::size_t row = 0; row < 3; ++row) {
      rows *= length(Vec3d{a.m[4 * row], a.m[4 * row + 1], a.m[4 * row + 2]});
      for (std::size_t column = 0; column < 4; ++column)
        sane = sane && std::abs(a.m[4 * row + column]) <= kLargest;
    }
    if (!sane) refuse(where, "has a transform beyond all numbers");
    if (!(std::abs(a.determinant()) > kLeastDeterminant * rows) || !(rows > 1e-30))
      refuse(where, "has a singular transform: it makes things flat");
  }

  // Each group once, so that what leads back to itself is found before it is followed. Returns how many
  // groups deep it is, itself counted.
  std::size_t check_group(const std::string& name) {
    if (const auto known = checked_.find(name); known != checked_.end()) return known->second;
    if (!open_.insert(name).second) refuse("group \"" + name + "\"", "contains itself");
    const std::size_t depth =
        open_.size() > kMostDepth ? kMostDepth : check_list(*groups_.at(name), "group \"" + name + "\"");
    if (depth >= kMostDepth)
      refuse("group \"" + name + "\"", "is more than " + std::to_string(kMostDepth) + " groups deep");
    open_.erase(name);
    return checked_[name] = depth + 1;
  }

  // How many groups deep the deepest of its groups is.
  std::size_t check_list(const Json& list, const std::string& where) {
    if (!list.is_array()) refuse(where, "is no list");
    std::size_t depth = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string which = where + "[" + std::to_string(i) + "]";
      const Json& json = list[i];
      if (!json.is_object()) refuse(which, "is no JSON object");
      check_words(json, which, {"object", "matrix", "translate", "rotate", "scale"});
      if (!json.contains("object")) refuse(which, "does not say which \"object\"");
      const std::string name = text_of(json["object"], which + ": \"object\"");
      transform_of(json, which);
      if (groups_.contains(name))
        depth = std::max(depth, check_group(name));
      else if (!files_.contains(name))
        refuse(which, "places \"" + name + "\", which is no object of the scene");
    }
    return depth;
  }

  void place(const Json& list, const std::string& where, const Affine& outer) {
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string which = where + "[" + std::to_string(i) + "]";
      const std::string& name = list[i]["object"].get_ref<const std::string&>();
      const Affine to_world = outer * transform_of(list[i], which);
      check_transform(to_world, which);
      if (++placed_ > 2 * kMostSceneInstances || scene_.instances.size() == kMostSceneInstances)
        refuse(which, "is one of more than a million instances");
      if (const auto file = files_.find(name); file != files_.end())
        scene_.instances.push_back({file->second, to_world});
      else
        place(*groups_.at(name), "group \"" + name + "\"", to_world);
    }
  }

  const std::string& path_;
  fs::path folder_;
  SceneFile scene_;
  std::map<std::string, std::size_t> files_;
  std::map<std::string, const Json*> groups_;
  std::deque<Json> groups_json_;
  std::set<std::string> open_;                  ///< groups on the way to the one that is checked
  std::map<std::string, std::size_t> checked_;  ///< those that are done, and how deep they are
  std::size_t placed_ = 0;                      ///< groups too
};

}  // namespace

bool is_scene(const std::string& path) { return fs::path(path).extension() == ".json"; }

SceneFile read_scene(const std::string& path) {
  const InputBytes input = read_input(path);
  return decode_scene(input.view(), path);
}

SceneFile decode_scene(std::string_view text, const std::string& path) { return Reader(path).read(text); }

}  // namespace rbvh
