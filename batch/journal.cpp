#include "batch/journal.h"

#include <sys/stat.h>

#include "io/hash.h"
#include "io/input_file.h"
#include "io/output_file.h"
#include "io/shallow_json.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

using nlohmann::ordered_json;

ordered_json to_json(const FileStamp& file) {
  return {{"path", file.path}, {"bytes", file.bytes}, {"modified", file.modified}, {"hash", file.hash}};
}

FileStamp stamp_of(const nlohmann::json& json) {
  return {json.at("path"), json.at("bytes"), json.at("modified"), json.at("hash")};
}

StepRecord record_of(const nlohmann::json& json) {
  StepRecord record{.step = json.at("step"),
                    .key = json.at("key"),
                    .outputs = {},
                    .seconds = json.at("seconds"),
                    .peak_bytes = json.at("peak_bytes"),
                    .warnings = json.at("warnings"),
                    .levels = json.at("levels")};
  for (const auto& output : json.at("outputs")) record.outputs.push_back(stamp_of(output));
  return record;
}

}  // namespace

std::optional<FileStamp> stamp(const std::string& path, const FileStamp* before) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0 || !S_ISREG(found.st_mode)) return std::nullopt;
  FileStamp file{path, static_cast<std::uint64_t>(found.st_size),
                 found.st_mtim.tv_sec * std::int64_t{1'000'000'000} + found.st_mtim.tv_nsec, 0};
  const bool is_as_before =
      before && before->path == path && before->bytes == file.bytes && before->modified == file.modified;
  file.hash = is_as_before ? before->hash : hash_file(path);
  return file;
}

Journal read_journal(const std::string& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return {};
  try {
    const InputBytes bytes = read_input(path);
    const nlohmann::json json = parse_shallow_json(bytes.view(), 8);
    if (json.is_discarded()) return {};
    Journal journal{stamp_of(json.at("source")), {}};
    for (const auto& step : json.at("steps")) journal.steps.push_back(record_of(step));
    return journal;
  } catch (const nlohmann::json::exception&) {
    return {};
  } catch (const Error&) {
    return {};
  }
}

void write_journal(const std::string& path, const Journal& journal) {
  ordered_json json{{"source", to_json(journal.source)}, {"steps", ordered_json::array()}};
  for (const StepRecord& record : journal.steps) {
    ordered_json outputs = ordered_json::array();
    for (const FileStamp& output : record.outputs) outputs.push_back(to_json(output));
    json["steps"].push_back({{"step", record.step},
                             {"key", record.key},
                             {"outputs", outputs},
                             {"seconds", record.seconds},
                             {"peak_bytes", record.peak_bytes},
                             {"warnings", record.warnings},
                             {"levels", record.levels}});
  }
  OutputFile file(path, true);
  file.write(json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  file.commit();
}

}  // namespace rbvh
