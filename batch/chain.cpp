#include "batch/chain.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "io/input_file.h"
#include "io/shallow_json.h"
#include "pipeline/base/error.h"
#include "pipeline/rbvh/check_rbvh.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

enum class Makes { kAsset, kFile, kText };

struct StageKind {
  std::string_view stage;
  Makes makes;
  bool reports, uses_device;
  std::string_view output;  // by default; behind "{name}"
};

constexpr StageKind kStages[] = {{"ingest", Makes::kAsset, true, false, ".ply"},
                                 {"build", Makes::kAsset, true, true, ".rbvh"},
                                 {"lod", Makes::kAsset, true, true, "-lod.rbvh"},
                                 {"paint", Makes::kAsset, true, true, "-painted.rbvh"},
                                 {"bake", Makes::kAsset, true, true, "-lit.rbvh"},
                                 {"proxy", Makes::kFile, true, false, "-proxy.obj"},
                                 {"mesh", Makes::kFile, true, false, "-mesh.ply"},
                                 {"render", Makes::kFile, true, true, ".png"},
                                 {"trace", Makes::kFile, true, true, "-hits.npy"},
                                 {"sample", Makes::kFile, true, true, "-samples.npy"},
                                 {"info", Makes::kText, false, false, "-info.json"},
                                 {"validate", Makes::kText, false, true, "-validate.json"}};

const StageKind* find_stage(std::string_view name) {
  const auto* found = std::find_if(std::begin(kStages), std::end(kStages),
                                   [&](const StageKind& kind) { return kind.stage == name; });
  return found == std::end(kStages) ? nullptr : found;
}

// Calls on_text and on_field in their order. A field is a word in braces: letters, digits, '-', '_', ':'.
template <class OnText, class OnField>
void scan_fields(std::string_view text, OnText on_text, OnField on_field) {
  const auto is_of_word = [](unsigned char c) { return std::isalnum(c) || c == '-' || c == '_' || c == ':'; };
  while (!text.empty()) {
    const std::size_t open = std::min(text.find('{'), text.size());
    on_text(text.substr(0, open));
    text.remove_prefix(open);
    if (text.empty()) return;
    std::size_t end = 1;
    while (end < text.size() && is_of_word(static_cast<unsigned char>(text[end]))) ++end;
    if (end < text.size() && end > 1 && text[end] == '}')
      on_field(text.substr(1, end - 1));
    else
      on_text(text.substr(0, end)), --end;
    text.remove_prefix(end + 1);
  }
}

bool is_of_the_stage(std::string_view field) {
  return field == "level" || field == "frame" || field.starts_with("frame:");
}

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::kInput, path, what);
}

std::string text_of(const nlohmann::json& value, const std::string& key, const std::string& path) {
  if (!value.is_string() || value.get<std::string>().find('\0') != std::string::npos)
    refuse(path, "\"" + key + "\" is no text");
  return value.get<std::string>();
}

std::vector<std::string> list_of(const nlohmann::json& value, const std::string& key,
                                 const std::string& path) {
  if (!value.is_array()) refuse(path, "\"" + key + "\" is no list");
  std::vector<std::string> list;
  for (const auto& entry : value) list.push_back(text_of(entry, key, path));
  return list;
}

void check_keys(const nlohmann::json& object, const std::set<std::string>& known, const std::string& path) {
  for (const auto& [key, value] : object.items())
    if (!known.contains(key)) {
      std::string names;
      for (const std::string& name : known) names.append(names.empty() ? "" : ", ").append(name);
      refuse(path, "\"" + key + "\" is no key here; there are " + names);
    }
}

ChainStep read_step(const nlohmann::json& entry, const std::string& asset, const std::string& path) {
  if (!entry.is_object()) refuse(path, "a step is no object");
  check_keys(entry, {"stage", "name", "input", "output", "options"}, path);
  if (!entry.contains("stage")) refuse(path, "a step has no \"stage\"");
  ChainStep step;
  step.stage = text_of(entry["stage"], "stage", path);
  const StageKind* kind = find_stage(step.stage);
  if (!kind) refuse(path, "'" + step.stage + "' is no stage for batches");
  step.name = entry.contains("name") ? text_of(entry["name"], "name", path) : step.stage;
  if (!is_name(step.name) || is_of_the_stage(step.name) || step.name == "name" || step.name == "source")
    refuse(
        path,
        "'" + step.name +
            "' is no name of a step: 1 to 32 letters, digits, _ and -, but not name, source, level or frame");
  step.input = entry.contains("input") ? text_of(entry["input"], "input", path) : "{" + asset + "}";
  step.output = entry.contains("output") ? text_of(entry["output"], "output", path)
                                         : "{name}" + std::string(kind->output);
  if (entry.contains("options")) step.options = list_of(entry["options"], "options", path);
  for (const char* own : {"-o", "--output", "-f", "--force", "--report", "--log", "--threads", "--memory",
                          "--device", "--progress"})
    for (const std::string& word : step.options)
      if (word == own || word.starts_with(std::string(own) + "="))
        refuse(path, "step '" + step.name + "': " + own + " is what the batch itself gives");
  return step;
}

// A name stays in the output folder, and each scan has its own.
void check_output_name(const ChainStep& step, const std::string& path) {
  const fs::path name(step.output);
  if (name.empty() || name.is_absolute() || std::find(name.begin(), name.end(), "..") != name.end())
    refuse(path, "step '" + step.name + "': its output is no name within the output folder");
  const std::vector<std::string> fields = fields_of(step.output);
  if (std::find(fields.begin(), fields.end(), "name") == fields.end())
    refuse(path, "step '" + step.name + "': its output lacks {name}, so that all scans would have the same");
}

void check_fields(const ChainStep& step, const std::set<std::string>& known, const std::string& path) {
  std::vector<std::string> texts = step.options;
  texts.push_back(step.input);
  for (const std::string& text : texts)
    for (const std::string& field : fields_of(text))
      if (!known.contains(field))
        refuse(path, "step '" + step.name + "': nothing before it is {" + field + "}");
  for (const std::string& field : fields_of(step.output))
    if (field != "name")
      refuse(path, "step '" + step.name + "': an output's name has {name}, not {" + field + "}");
}

}  // namespace

std::vector<std::string> fields_of(std::string_view text) {
  std::vector<std::string> fields;
  scan_fields(
      text, [](std::string_view) {},
      [&](std::string_view field) {
        if (!is_of_the_stage(field)) fields.emplace_back(field);
      });
  return fields;
}

std::string fill_fields(std::string_view text, const std::map<std::string, std::string>& values) {
  std::string filled;
  scan_fields(
      text, [&](std::string_view literal) { filled += literal; },
      [&](std::string_view field) {
        const auto value = values.find(std::string(field));
        filled += value != values.end() ? value->second : "{" + std::string(field) + "}";
      });
  return filled;
}

bool prints(const ChainStep& step) { return find_stage(step.stage)->makes == Makes::kText; }

bool reports(const ChainStep& step) { return find_stage(step.stage)->reports; }

bool uses_device(const ChainStep& step) { return find_stage(step.stage)->uses_device; }

Chain default_chain() {
  return {{},
          {{"ingest", "ingest", "{source}", "{name}.ply", {}},
           {"build", "build", "{ingest}", "{name}.rbvh", {}},
           {"render", "render", "{build}", "{name}.png", {}}}};
}

Chain read_chain(const std::string& path) { return decode_chain(read_input(path).view(), path); }

Chain decode_chain(std::string_view bytes, const std::string& path) {
  const nlohmann::json json = parse_shallow_json(bytes, 4);
  if (!json.is_object()) refuse(path, "is no manifest of a batch: a JSON object with \"steps\"");
  check_keys(json, {"inputs", "steps"}, path);
  Chain chain;
  if (json.contains("inputs"))
    for (const std::string& input : list_of(json["inputs"], "inputs", path))
      chain.inputs.push_back((fs::path(path).parent_path() / input).string());
  if (!json.contains("steps")) {
    chain.steps = default_chain().steps;
    return chain;
  }
  if (!json["steps"].is_array() || json["steps"].empty()) refuse(path, "\"steps\" is no list with a step");
  std::set<std::string> known{"name", "source"}, outputs;
  std::string asset = "source";
  for (const auto& entry : json["steps"]) {
    ChainStep step = read_step(entry, asset, path);
    check_output_name(step, path);
    check_fields(step, known, path);
    if (!known.insert(step.name).second)
      refuse(path, "two steps are called '" + step.name + "'; give one another \"name\"");
    if (!outputs.insert(step.output).second)
      refuse(path, "two steps write " + step.output + "; give one another \"output\"");
    if (find_stage(step.stage)->makes == Makes::kAsset) asset = step.name;
    chain.steps.push_back(std::move(step));
  }
  return chain;
}

}  // namespace rbvh
