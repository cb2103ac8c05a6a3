#include "io/describe_text.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "pipeline/base/text.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

// Names out of a file go to a terminal only without its control characters.
std::string printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return text;
}

std::string vec_text(const Json& v) {
  return fmt::format("{:.9g} {:.9g} {:.9g}", v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
}

std::string bounds_text(const Json& b) {
  return b.is_null() ? "none" : vec_text(b["lo"]) + " to " + vec_text(b["hi"]);
}

// "1 level": of the JSON's own "levels".
std::string count(const Json& json, const std::string& noun) {
  return counted(json[plural(noun)].get<std::uint64_t>(), noun);
}

/// "1.6e-05   0.000432": an error of the diagonal, and in scan units.
std::string error_text(const Json& of, const char* part, const char* length) {
  const double error = of.is_null() || of[part].is_null() ? 0 : of[part].get<double>();
  if (!(error > 0)) return fmt::format("{:>9} {:>11}", "-", "-");
  return fmt::format("{:>9.3g} {:>11.4g}", error, of[length].get<double>());
}

/// What was asked for and what was reached.
std::string errors_text(const Json& json) {
  const Json& source = json["source"];
  const std::string units = source["units"] == "unknown" ? "units" : printable(source["units"]);
  std::string text = fmt::format("errors, of the diagonal ({:.6g} {}) and in {}\n",
                                 source["diagonal"].get<double>(), units, units);
  text += "level               asked for          reached, rms      reached, at most\n";
  for (const Json& level : json["levels"])
    text +=
        fmt::format("{:<6} {} {} {}\n", printable(level["name"]), error_text(level, "error", "error_length"),
                    error_text(level["reached"], "error", "error_length"),
                    error_text(level["reached"], "max", "max_length"));
  return text;
}

/// Where the bytes are: a row for each level, a column for each stream and layer that any of them has.
std::string bytes_text(const Json& json) {
  std::vector<std::pair<std::string, std::vector<std::uint64_t>>> columns;
  const std::size_t count = json["levels"].size();
  const auto add = [&](const std::string& name, std::size_t level, std::uint64_t bytes) {
    auto column =
        std::find_if(columns.begin(), columns.end(), [&](const auto& c) { return c.first == name; });
    if (column == columns.end()) column = columns.insert(column, {name, std::vector<std::uint64_t>(count)});
    column->second[level] = bytes;
  };
  for (std::size_t i = 0; i < count; ++i)
    for (const auto& [name, bytes] : json["levels"][i]["streams"].items()) add(name, i, bytes);
  for (std::size_t i = 0; i < count; ++i) {
    const Json& level = json["levels"][i];
    std::uint64_t rest = level["bytes"];
    for (const Json& layer : level["layers"]) add("layer " + printable(layer["name"]), i, layer["bytes"]);
    for (const auto& column : columns) rest -= std::min(rest, column.second[i]);
    add("other", i, rest);
  }
  std::string text = "bytes ";
  std::erase_if(columns, [](const auto& c) {
    return std::all_of(c.second.begin(), c.second.end(), [](std::uint64_t bytes) { return bytes == 0; });
  });
  for (const auto& [name, bytes] : columns) text += fmt::format("  {:>10}", name);
  text += "         all\n";
  for (std::size_t i = 0; i < count; ++i) {
    text += fmt::format("{:<6}", printable(json["levels"][i]["name"]));
    for (const auto& [name, bytes] : columns)
      text += fmt::format("  {:>{}}", bytes[i], std::max<std::size_t>(10, name.size()));
    text += fmt::format("  {:>10}\n", json["levels"][i]["bytes"].get<std::uint64_t>());
  }
  return text;
}

std::string pair_text(const Json& json, bool with_bytes) {
  const Json& source = json["source"];
  const auto string = [](const Json& value) { return printable(value.get<std::string>()); };
  const auto bytes = [](const Json& value) { return format_bytes(value.get<std::uint64_t>()); };
  std::string text = string(json["file"]) + ": RBVH pair, format " + string(json["format"]) + ", " +
                     bytes(json["bytes"]) + " (hierarchy " + bytes(json["hierarchy"]["bytes"]) + ", atlas " +
                     bytes(json["atlas"]["bytes"]) + ")\n";
  text += "source   " + string(source["name"]) + " (" + string(source["hash"]) +
          "): " + string(source["kind"]) + ", " + count(source, "vertex") + ", " + count(source, "triangle") +
          ", area " + fmt::format("{:.6g}", source["area"].get<double>()) + ", units " +
          string(source["units"]) + "\n";
  text += "bounds   " + bounds_text(source["bounds"]) + "\n";
  text += "shift    " + vec_text(source["shift"]) + "\n";
  text += "options  " + printable(json["build_options"].dump()) + "\n";
  text +=
      "level       rho  alpha  phi   leaves    exact    nodes        atlas  used      bytes  per primitive  "
      "layers\n";
  for (const Json& level : json["levels"]) {
    const auto width = level["atlas"][0].get<std::uint64_t>(),
               height = level["atlas"][1].get<std::uint64_t>();
    std::string layers;
    for (const Json& layer : level["layers"])
      layers.append(layers.empty() ? "" : " ").append(string(layer["name"]));
    const Json& each = level["bytes_per_primitive"];
    text += fmt::format(
        "{:<6} {:>8.6g}  {:>5.3g}  {:>3.3g} {:>8} {:>8} {:>8} {:>12}  {:>3.0f}% {:>10} {:>14}  {}\n",
        string(level["name"]), level["rho"].get<double>(), level["alpha"].get<double>(),
        level["phi_degrees"].get<double>(), level["leaves"].dump(), level["primitive_leaves"].dump(),
        level["nodes"].dump(), fmt::format("{} x {}", width, height),
        100 * level["texels_used"].get<double>() / static_cast<double>(width * height), bytes(level["bytes"]),
        each.is_null() ? "-" : fmt::format("{:.3g} B", each.get<double>()), layers);
  }
  text += errors_text(json);
  if (with_bytes) text += bytes_text(json);
  for (const Json& level : json["levels"])
    if (!level["derived_from"].is_null())
      text += string(level["name"]) + " is derived from " + string(level["derived_from"]) + "\n";
  for (const Json& level : json["levels"]) {
    const Json& f = level["fidelity"];
    if (f.is_null()) continue;
    const auto figure = [&](const char* pointer) { return f.at(Json::json_pointer(pointer)).get<double>(); };
    text += string(level["name"]) + " against its source: mask mismatch " +
            fmt::format("{:.3g}%, |dt| median {:.2g}, p99 {:.2g} of the diagonal; worst view: {}, {}, {}\n",
                        figure("/mask_mismatch_percent"), figure("/median_dt"), figure("/p99_dt"),
                        count(f, "hole"), count(f, "leak"), count(f, "wall"));
    if (f.contains("image"))
      text += fmt::format(
          "   surface distance {:.2g}% rms, {:.2g}% at most; normals {:.2g} degrees (p95 {:.2g}); image RMSE "
          "{:.3g}, {} of the control's; {} of {} x {}\n",
          std::max(figure("/level_to_scan/rms_percent"), figure("/scan_to_level/rms_percent")),
          std::max(figure("/level_to_scan/max_percent"), figure("/scan_to_level/max_percent")),
          figure("/normal_degrees/median"), figure("/normal_degrees/p95"), figure("/image/rmse"),
          f["image_relative"].is_null() ? "-" : fmt::format("{:.2f}", figure("/image_relative")),
          count(f, "view"), f["resolution"].dump(), f["resolution"].dump());
  }
  return text;
}

std::string proxy_text(const Json& json) {
  const auto bytes = [](const Json& value) { return format_bytes(value.get<std::uint64_t>()); };
  const Json &source = json["source"], &map = json["map"];
  std::string text = printable(json["file"].get<std::string>()) + ": proxy, format " +
                     json["format"].get<std::string>() + ", " + bytes(json["bytes"]) + " (mesh " +
                     bytes(json["mesh"]["bytes"]) + ", map " + bytes(map["bytes"]) + ")\n";
  text += "source   " + printable(source["name"].get<std::string>()) + " (" +
          source["hash"].get<std::string>() + ")\n";
  text += "base     " + count(json, "patch") + ", " + count(json, "vertex") + ", " +
          bounds_text(json["base_bounds"]) + "\n";
  text += "surface  " + bounds_text(json["bounds"]) + ", displaced by up to " +
          fmt::format("{:.6g}", json["longest_displacement"].get<double>()) + "\n";
  text += "shift    " + vec_text(source["shift"]) + "\n";
  text += fmt::format("map      {} x {}, {} texels in tiles of", map["size"][0].dump(), map["size"][1].dump(),
                      json["texels"].dump());
  for (const Json& tile : json["tiles"])
    text += fmt::format(" {} x {} ({})", tile["side"].dump(), tile["side"].dump(), tile["patches"].dump());
  return text + "\n";
}

std::string scene_text(const Json& json) {
  const auto string = [](const Json& value) { return printable(value.get<std::string>()); };
  const auto bytes = [](const Json& value) { return format_bytes(value.get<std::uint64_t>()); };
  std::string text = string(json["file"]) + ": scene, " +
                     counted(json["instances"].get<std::uint64_t>(), "instance") + ", " +
                     counted(json["leaves"].get<std::uint64_t>(), "leaf") + ", " + bytes(json["bytes"]) +
                     " with all its files\n";
  text += "bounds   " + bounds_text(json["bounds"]) + ", up " + string(json["up"]) + "\n";
  text += "shift    " + vec_text(json["shift"]) + "\n";
  for (const Json& object : json["objects"])
    text += fmt::format("{:<8} {} {}, {}, {}, placed {}\n", string(object["name"]), string(object["file"]),
                        object["level"].is_null() ? string(object["kind"]) : string(object["level"]),
                        counted(object["leaves"].get<std::uint64_t>(), "leaf"), bytes(object["bytes"]),
                        counted(object["instances"].get<std::uint64_t>(), "time"));
  return text;
}

std::string parts_text(const Json& json) {
  const auto bytes = [](const Json& value) { return format_bytes(value.get<std::uint64_t>()); };
  const Json& source = json["source"];
  std::string text = printable(json["file"].get<std::string>()) + ": pair of " +
                     counted(json["parts"].size(), "part") + ", " + bytes(json["bytes"]) +
                     " with all its files\n";
  text += "source   " + printable(source["name"].get<std::string>()) + " (" +
          source["hash"].get<std::string>() + "), " + count(source, "vertex") + ", " +
          count(source, "triangle") + "\n";
  text += "bounds   " + bounds_text(source["bounds"]) + "\n";
  text += "shift    " + vec_text(source["shift"]) + "\n";
  text += "level     error     reached     leaves      bytes\n";
  for (const Json& level : json["levels"])
    text += fmt::format("{:<6} {:>9.3g} {:>9.3g} {:>12} {:>10}\n", printable(level["name"]),
                        level["error"].get<double>(), level["reached"].get<double>(), level["leaves"].dump(),
                        bytes(level["bytes"]));
  for (const Json& part : json["parts"])
    text += fmt::format("{} {}, {}\n", printable(part["file"].get<std::string>()), bytes(part["bytes"]),
                        bounds_text(part["bounds"]));
  return text;
}

std::string scan_text(const Json& json) {
  std::string text = printable(json["file"].get<std::string>()) + ": " + json["kind"].get<std::string>() +
                     ", " + count(json, "vertex") + ", " + count(json, "triangle") + ", " +
                     count(json, "object");
  if (json.contains("area")) text += ", area " + fmt::format("{:.6g}", json["area"].get<double>());
  text += "\n";
  if (json["non_finite"] != 0)
    text += "not finite  " + counted(json["non_finite"].get<std::uint64_t>(), "vertex") + "\n";
  text += "bounds      " + bounds_text(json["bounds"]) + "\n";
  text += "shift       " + vec_text(json["shift"]) + "\n";
  text += "units       " + json["units"].get<std::string>() + "\n";
  text += "vertices    position";
  for (const char* attribute : {"normals", "radii", "colors"})
    if (json[attribute].get<bool>()) text += std::string(" ") + attribute;
  for (const Json& name : json["properties"]) text += " " + printable(name.get<std::string>());
  text += "\n";
  for (const Json& texture : json["textures"])
    text += fmt::format("texture     {} ({} x {})\n", printable(texture["image"].get<std::string>()),
                        texture["width"].get<std::uint32_t>(), texture["height"].get<std::uint32_t>());
  for (const Json& sentence : json["notes"])
    text += "note        " + printable(sentence.get<std::string>()) + "\n";
  return text;
}

}  // namespace

std::string describe_text(const Json& json, bool with_bytes) {
  const std::string kind = json["kind"].get<std::string>();
  return kind == "rbvh"    ? pair_text(json, with_bytes)
         : kind == "proxy" ? proxy_text(json)
         : kind == "scene" ? scene_text(json)
         : kind == "parts" ? parts_text(json)
                           : scan_text(json);
}

}  // namespace rbvh
