#include "batch/batch_table.h"

#include <algorithm>
#include <filesystem>

#include "io/output_file.h"
#include "rbvh/version.h"

namespace rbvh {
namespace {

using nlohmann::ordered_json;
using State = ScanResult::State;

const char* word(State state) {
  if (state == State::kFailed) return "failed";
  return state == State::kUpToDate ? "up to date" : "done";
}

ordered_json row_of(const ScanResult& result) {
  std::uint64_t bytes_out = 0, peak = 0, warnings = 0;
  double seconds = 0;
  ordered_json levels;
  for (const StepRecord& step : result.journal.steps) {
    for (const FileStamp& output : step.outputs) bytes_out += output.bytes;
    peak = std::max(peak, step.peak_bytes);
    warnings += step.warnings;
    seconds += step.seconds;
    if (!step.levels.is_null()) levels = step.levels;
  }
  ordered_json row{{"name", result.scan.name},
                   {"source", result.scan.path},
                   {"state", word(result.state)},
                   {"bytes_in", result.journal.source.bytes},
                   {"bytes_out", bytes_out},
                   {"seconds", seconds},
                   {"peak_bytes", peak},
                   {"warnings", warnings},
                   {"levels", levels}};
  if (result.error) row["error"] = result.error->what();
  if (!result.failed_step.empty())
    row.update({{"step", result.failed_step}, {"exit_code", result.exit_code}});
  return row;
}

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string all = "\"";
  for (const char c : text) all.append(c == '"' ? 2 : 1, c);
  return all + "\"";
}

std::string cell(const ordered_json& row, const std::string& key) {
  if (!row.contains(key) || row[key].is_null()) return "";
  return row[key].is_string() ? quoted(row[key].get<std::string>()) : row[key].dump();
}

}  // namespace

ordered_json batch_json(const std::vector<ScanResult>& results) {
  const auto count = [&](State state) {
    return std::count_if(results.begin(), results.end(),
                         [state](const ScanResult& result) { return result.state == state; });
  };
  ordered_json table{{"stage", "batch"},
                     {"version", version()},
                     {"counts",
                      {{"scans", results.size()},
                       {"done", count(State::kDone)},
                       {"up_to_date", count(State::kUpToDate)},
                       {"failed", count(State::kFailed)}}},
                     {"scans", ordered_json::array()}};
  for (const ScanResult& result : results) table["scans"].push_back(row_of(result));
  return table;
}

std::string batch_csv(const ordered_json& table) {
  std::vector<std::string> levels;
  for (const auto& row : table["scans"])
    for (const auto& level : row["levels"])
      if (const std::string name = level.value("name", "");
          std::find(levels.begin(), levels.end(), name) == levels.end())
        levels.push_back(name);
  std::sort(levels.begin(), levels.end());
  const std::vector<std::string> keys{"name",       "source",   "state", "bytes_in",  "bytes_out", "seconds",
                                      "peak_bytes", "warnings", "step",  "exit_code", "error"};
  std::string text;
  for (const std::string& key : keys) text += key + ",";
  for (const std::string& level : levels) text += quoted(level + "_error") + ",";
  text.back() = '\n';
  for (const auto& row : table["scans"]) {
    for (const std::string& key : keys) text += cell(row, key) + ",";
    for (const std::string& name : levels) {
      for (const auto& level : row["levels"])
        if (level.value("name", "") == name)
          text += cell(level, level.value("reached", 0.0) > 0 ? "reached" : "error");
      text += ",";
    }
    text.back() = '\n';
  }
  return text;
}

void write_tables(const std::string& output, const Shard& part, const ordered_json& table) {
  const std::string name =
      part.count == 1 ? "batch" : "batch-" + std::to_string(part.index) + "-of-" + std::to_string(part.count);
  const auto write = [&](const std::string& extension, const std::string& text) {
    OutputFile file((std::filesystem::path(output) / (name + extension)).string(), true);
    file.write(text);
    file.commit();
  };
  write(".json", table.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  write(".csv", batch_csv(table));
}

}  // namespace rbvh
