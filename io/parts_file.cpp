#include "io/parts_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "io/hash.h"
#include "io/input_file.h"
#include "io/leftovers.h"
#include "io/load_asset.h"
#include "io/output_file.h"
#include "io/posix_file.h"
#include "io/rbvh_file.h"
#include "io/shallow_json.h"
#include "pipeline/base/error.h"
#include "pipeline/scene/asset_content.h"
#include "pipeline/trace/make_tracer.h"

namespace rbvh {
namespace {

using Json = nlohmann::ordered_json;

// "RBVHPARTS 1 HASH": the hash of all bytes that follow the line.
constexpr std::string_view kMagic = kPartsMagic;
constexpr std::string_view kVersion = "1";
constexpr int kMostDepth = 8, kHashDigits = 16;
constexpr std::size_t kMostLevels = 32;

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::kInput, path, what + "; build it again");
}

template <class T>
Json vec_json(const Vec3<T>& v) {
  return {v.x, v.y, v.z};
}
Json bounds_json(const Bounds3f& b) { return {{"lo", vec_json(b.lo)}, {"hi", vec_json(b.hi)}}; }

Json source_json(const RbvhSource& source) {
  return {{"name", source.name},         {"hash", hash_digits(source.hash)},
          {"vertices", source.vertices}, {"triangles", source.triangles},
          {"area", source.area},         {"shift", vec_json(source.shift)},
          {"units", source.units},       {"bounds", bounds_json(source.bounds)}};
}

/// Reads what nlohmann's get() would take for another type, and refuses what is not finite.
class Fields {
 public:
  explicit Fields(const std::string& path) : path_(path) {}
  [[noreturn]] void fail(const char* key) const {
    refuse(path_, "is damaged: '" + std::string(key) + "' is missing or wrong");
  }
  const nlohmann::json& at(const nlohmann::json& of, const char* key) const {
    if (!of.is_object() || !of.contains(key)) fail(key);
    return of[key];
  }
  const nlohmann::json& list(const nlohmann::json& of, const char* key, std::size_t most) const {
    const nlohmann::json& found = at(of, key);
    if (!found.is_array() || found.empty() || found.size() > most) fail(key);
    return found;
  }
  std::uint64_t count(const nlohmann::json& of, const char* key) const {
    const nlohmann::json& found = at(of, key);
    if (!found.is_number_unsigned()) fail(key);
    return found;
  }
  double number(const nlohmann::json& of, const char* key) const {
    const nlohmann::json& found = at(of, key);
    if (!found.is_number() || !std::isfinite(found.get<double>())) fail(key);
    return found;
  }
  float real(const nlohmann::json& of, const char* key) const {
    const auto value = static_cast<float>(number(of, key));
    if (!std::isfinite(value)) fail(key);
    return value;
  }
  std::string text(const nlohmann::json& of, const char* key) const {
    const nlohmann::json& found = at(of, key);
    if (!found.is_string()) fail(key);
    return found;
  }
  std::uint64_t hash(const nlohmann::json& of, const char* key) const {
    const std::string digits = text(of, key);
    if (digits.size() != kHashDigits || digits.find_first_not_of("0123456789abcdef") != std::string::npos)
      fail(key);
    return std::stoull(digits, nullptr, 16);
  }
  Vec3d vec(const nlohmann::json& of, const char* key) const {
    const nlohmann::json& found = at(of, key);
    if (!found.is_array() || found.size() != 3) fail(key);
    Vec3d v;
    for (int axis = 0; axis < 3; ++axis) {
      const nlohmann::json& one = found[static_cast<std::size_t>(axis)];
      if (!one.is_number() || !std::isfinite(one.get<double>())) fail(key);
      v[axis] = one;
    }
    return v;
  }
  Bounds3f bounds(const nlohmann::json& of) const {
    const nlohmann::json& found = at(of, "bounds");
    const Bounds3f box{static_cast<Vec3f>(vec(found, "lo")), static_cast<Vec3f>(vec(found, "hi"))};
    if (box.empty() || !is_finite(box.lo) || !is_finite(box.hi)) fail("bounds");
    return box;
  }

 private:
  const std::string& path_;
};

/// A pair in a folder beside the table, or beside it: nowhere else.
bool is_beside(const std::string& file) {
  const std::filesystem::path path = file;
  return !file.empty() && path.is_relative() && path.extension() == ".rbvh" &&
         std::none_of(path.begin(), path.end(), [](const auto& word) { return word == ".." || word == "."; });
}

}  // namespace

nlohmann::ordered_json part_to_json(const PairPart& part) {
  Json json = {{"file", part.file},
               {"bytes", part.bytes},
               {"hierarchy", hash_digits(part.hierarchy)},
               {"atlas", hash_digits(part.atlas)},
               {"vertices", part.vertices},
               {"triangles", part.triangles},
               {"levels", Json::array()}};
  for (const PartLevel& level : part.levels)
    json["levels"].push_back({{"leaves", level.leaves},
                              {"bytes", level.bytes},
                              {"memory", level.memory},
                              {"reached", level.reached},
                              {"bounds", bounds_json(level.bounds)}});
  return json;
}

PairPart part_from_json(const nlohmann::json& json, const std::string& path) {
  const Fields fields(path);
  PairPart part{.file = fields.text(json, "file"),
                .bytes = fields.count(json, "bytes"),
                .hierarchy = fields.hash(json, "hierarchy"),
                .atlas = fields.hash(json, "atlas"),
                .vertices = fields.count(json, "vertices"),
                .triangles = fields.count(json, "triangles"),
                .levels = {}};
  if (!is_beside(part.file)) fields.fail("file");
  for (const nlohmann::json& level : fields.list(json, "levels", kMostLevels)) {
    part.levels.push_back({.leaves = fields.count(level, "leaves"),
                           .bytes = fields.count(level, "bytes"),
                           .memory = fields.count(level, "memory"),
                           .bounds = fields.bounds(level),
                           .reached = fields.real(level, "reached")});
    if (part.levels.back().leaves == 0 || part.levels.back().leaves >= RBVH_NO_LEAF) fields.fail("leaves");
  }
  return part;
}

bool is_parts(const std::string& path) {
  std::error_code code;
  if (path == "-" || !std::filesystem::is_regular_file(path, code)) return false;
  char start[kMagic.size()] = {};
  std::ifstream(path, std::ios::binary).read(start, sizeof start);
  return std::string_view(start, sizeof start) == kMagic;
}

PartsTable decode_parts(std::string_view text, const std::string& path) {
  if (!text.starts_with(kMagic)) refuse(path, "is no table of parts");
  const std::string_view line = text.substr(0, text.find('\n'));
  const std::string_view words = line.substr(kMagic.size());
  const std::string_view version = words.substr(0, words.find(' '));
  if (version != kVersion)
    throw Error(ErrorKind::kInput, path,
                "is a pair of parts of another version than " + std::string(kVersion) + "; use a newer rbvh");
  const std::string_view body = text.substr(std::min(text.size(), line.size() + 1));
  if (words.substr(std::min(words.size(), version.size() + 1)) != hash_digits(hash_bytes(body)))
    refuse(path, "is cut or damaged: its bytes do not have the hash that it carries");
  const nlohmann::json json = parse_shallow_json(body, kMostDepth);
  const Fields fields(path);
  if (json.is_discarded()) refuse(path, "is damaged: its text is no JSON");
  PartsTable table;
  const nlohmann::json& source = fields.at(json, "source");
  table.source = {.name = fields.text(source, "name"),
                  .hash = fields.hash(source, "hash"),
                  .vertices = fields.count(source, "vertices"),
                  .triangles = fields.count(source, "triangles"),
                  .area = fields.number(source, "area"),
                  .shift = fields.vec(source, "shift"),
                  .units = fields.text(source, "units"),
                  .bounds = fields.bounds(source)};
  table.build_options = fields.at(json, "build_options").dump();
  for (const nlohmann::json& level : fields.list(json, "levels", kMostLevels))
    table.levels.push_back({fields.text(level, "name"), fields.real(level, "rho"),
                            fields.real(level, "error"), fields.real(level, "reached")});
  for (const nlohmann::json& part : fields.list(json, "parts", kMostParts)) {
    table.parts.push_back(part_from_json(part, path));
    if (table.parts.back().levels.size() != table.levels.size()) fields.fail("levels");
  }
  return table;
}

PartsTable read_parts(const std::string& path) {
  const InputBytes bytes = read_input(path);
  return decode_parts(bytes.view(), path);
}

void write_parts(const std::string& path, const PartsTable& table, bool overwrite) {
  Json json = {{"source", source_json(table.source)},
               {"build_options", Json::parse(table.build_options)},
               {"levels", Json::array()},
               {"parts", Json::array()}};
  for (const PartsTable::Level& level : table.levels)
    json["levels"].push_back(
        {{"name", level.name}, {"rho", level.rho}, {"error", level.error}, {"reached", level.reached}});
  for (const PairPart& part : table.parts) json["parts"].push_back(part_to_json(part));
  const std::string body = json.dump(1) + "\n";
  OutputFile file(path, overwrite);
  file.write(std::string(kMagic) + std::string(kVersion) + " " + hash_digits(hash_bytes(body)) + "\n");
  file.write(body);
  const std::vector<std::string> replaced = files_of_pair(path);
  file.commit();
  remove_leftovers(replaced);
}

std::string part_path(const std::string& table_path, const PairPart& part) {
  return (std::filesystem::path(follow_link(table_path)).parent_path() / part.file).string();
}

Json check_parts(const std::string& path, const MemoryBudget& memory, const Progress& progress) {
  check_read_budget(memory, path);
  const PartsTable table = read_parts(path);
  std::uint64_t leaves = 0;
  for (std::size_t i = 0; i < table.parts.size(); ++i) {
    report(progress, "validate", static_cast<double>(i) / static_cast<double>(table.parts.size()));
    const PairPart& part = table.parts[i];
    const std::string file = part_path(path, part);
    PairHeader header;
    const Rbvh rbvh = load_pair(file, memory, &header);
    bool is_it = header.hierarchy_hash == part.hierarchy && rbvh.levels.size() == table.levels.size();
    for (std::size_t k = 0; is_it && k < rbvh.levels.size(); ++k) {
      is_it = rbvh.levels[k].name == table.levels[k].name &&
              rbvh.levels[k].leaves.size() == part.levels[k].leaves;
      leaves += rbvh.levels[k].leaves.size();
    }
    if (!is_it) throw Error(ErrorKind::kInput, file, "is not the part that its table names; build it again");
  }
  return {
      {"kind", "parts"}, {"parts", table.parts.size()}, {"levels", table.levels.size()}, {"leaves", leaves}};
}

Asset load_parts(const std::string& path, const LoadConfig& config) {
  check_read_budget(config.memory, path);
  const PartsTable table = read_parts(path);
  std::vector<std::string> names;
  for (const PartsTable::Level& level : table.levels) names.push_back(level.name);
  const std::vector<std::string> wanted = config.levels.value_or(std::vector<std::string>{});
  if (wanted == std::vector<std::string>{"auto"} || wanted.size() > 1 ||
      wanted == std::vector<std::string>{"all"})
    throw Error(ErrorKind::kUsage, path, "is a pair of parts, of which one level at a time is loaded");
  const std::string name = choose_levels(names, wanted, path).front();
  const auto number = static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  Scene scene;
  scene.shift = table.source.shift;
  scene.level = name;
  scene.resident_bytes = memory_limit(config.memory) / 2;
  scene.z_is_up = table.source.triangles == 0;
  for (const PairPart& part : table.parts) {
    const PartLevel& level = part.levels[number];
    SceneObject object;
    object.name = part.file;
    object.shift = table.source.shift;
    object.bounds = level.bounds;
    object.content = LevelOnDemand{
        .leaves = static_cast<std::uint32_t>(level.leaves),
        .bytes = level.memory,
        .load = [file = part_path(path, part), name, memory = config.memory, hash = part.hierarchy,
                 leaves = level.leaves] {
          PairHeader header;
          Rbvh rbvh = load_pair(file, memory, &header,
                                [&](const std::vector<std::string>&) { return std::vector{name}; });
          if (header.hierarchy_hash != hash || rbvh.levels[0].leaves.size() != leaves)
            throw Error(ErrorKind::kInput, file, "is not the part that its table names; build it again");
          return std::move(rbvh.levels[0]);
        }};
    scene.instances.push_back({static_cast<std::uint32_t>(scene.objects.size()), Affine{}});
    scene.objects.push_back(std::move(object));
  }
  Asset asset = make_asset(std::move(scene));
  asset.bounds = table.source.bounds;
  asset.is_cloud = table.source.triangles == 0;
  return asset;
}

}  // namespace rbvh
