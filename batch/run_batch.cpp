#include "batch/run_batch.h"

#include <fcntl.h>
#include <sys/file.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>
#include <thread>

#include "batch/run_tool.h"
#include "io/hash.h"
#include "io/input_file.h"
#include "io/output_file.h"
#include "io/posix_file.h"
#include "io/proxy_file.h"
#include "io/shallow_json.h"
#include "pipeline/base/error.h"
#include "rbvh/version.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;
using State = ScanResult::State;

constexpr int kOverBudget = 5;  // the tool's exit code

// Files that options name, such as rays or a sky, and the hashes of their content.
using OptionFiles = std::map<std::string, std::uint64_t>;

// Where the journal and the logs of a scan lie, and the values of its fields.
struct Work {
  const BatchConfig& config;
  const OptionFiles& option_files;
  const BatchScan& scan;
  std::string base;  // OUTPUT/.rbvh-batch/NAME
  std::map<std::string, std::string> values;
  int threads;
  std::uint64_t memory;
};

// OUTPUT/NAME.EXT
std::string output_path(const std::string& folder, const BatchScan& scan, const ChainStep& step) {
  return (fs::path(folder) / fill_fields(step.output, {{"name", scan.name}})).string();
}
std::string output_path(const Work& work, const ChainStep& step) {
  return output_path(work.config.output, work.scan, step);
}

// The value of "--rays=FILE"; any other word as it is.
std::string value_of(const std::string& word) {
  const std::size_t equals = word.starts_with("--") ? word.find('=') : std::string::npos;
  return equals == std::string::npos ? word : word.substr(equals + 1);
}

OptionFiles find_option_files(const Chain& chain) {
  OptionFiles files;
  for (const ChainStep& step : chain.steps)
    for (const std::string& word : step.options)
      if (const auto found = stamp(value_of(word))) files[found->path] = found->hash;
  return files;
}

// Files that other files belong to, such as textures, which may change while these stay.
bool has_parts(const std::string& source) {
  const std::string extension = fs::path(source).extension().string();
  if (extension == ".gltf" || extension == ".json" || is_proxy(source)) return true;
  const char* word = extension == ".obj" ? "mtllib" : extension == ".ply" ? "TextureFile" : nullptr;
  return word != nullptr && read_input(source).view().find(word) != std::string_view::npos;
}

void make_folder_of(const std::string& path) {
  std::error_code code;
  fs::create_directories(fs::path(path).parent_path(), code);
  if (code) fail_output(path, "its folder cannot be made", code.value());
}

// Whether `name` is what a stage makes of a template whose fields are the stage's own.
bool fits(std::string_view name, std::string_view pattern) {
  const std::size_t open = pattern.find('{');
  const std::size_t close = pattern.find('}', std::min(open, pattern.size()));
  if (close == std::string_view::npos) return name == pattern;
  if (!name.starts_with(pattern.substr(0, open))) return false;
  name.remove_prefix(open);
  pattern.remove_prefix(close + 1);
  for (std::size_t skipped = 0; skipped <= name.size(); ++skipped)
    if (fits(name.substr(skipped), pattern)) return true;
  return false;
}

// What the stage wrote for an output of that name: files that belong together, or one a level and camera.
std::vector<std::string> written_files(const std::string& output) {
  const fs::path path(output);
  std::vector<std::string> patterns{path.filename().string()};
  const std::string stem = path.stem().string();
  if (path.extension() == ".rbvh") patterns.push_back(stem + ".atlas.tif");
  if (path.extension() == ".obj") patterns.insert(patterns.end(), {stem + ".vdm.exr", stem + ".vdm.json"});
  std::vector<std::string> files;
  std::error_code code;
  for (const auto& entry : fs::directory_iterator(path.parent_path(), code))
    for (const std::string& pattern : patterns)
      if (fits(entry.path().filename().string(), pattern)) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

const StepRecord* find_step(const Journal& journal, const std::string& name) {
  const auto found = std::find_if(journal.steps.begin(), journal.steps.end(),
                                  [&](const StepRecord& record) { return record.step == name; });
  return found == journal.steps.end() ? nullptr : &*found;
}

std::vector<std::string> words_of(const Work& work, const ChainStep& step) {
  std::vector<std::string> words{step.stage};
  for (const std::string& option : step.options) words.push_back(fill_fields(option, work.values));
  if (!prints(step)) words.insert(words.end(), {"-o", output_path(work, step)});
  words.insert(words.end(), {"--", fill_fields(step.input, work.values)});
  return words;
}

// Of all that decides the step's output: the words, the version, the content of what it reads.
std::uint64_t key_of(const Work& work, const std::vector<std::string>& words, const ChainStep& step,
                     const Journal& done) {
  std::string text = version();
  for (const std::string& word : words) {
    text += '\0' + word;
    const auto file = work.option_files.find(value_of(word));
    if (file != work.option_files.end()) text += '\0' + std::to_string(file->second);
  }
  text += '\0' + work.config.device;
  std::vector<std::string> read = fields_of(step.input);
  for (const std::string& option : step.options)
    for (const std::string& field : fields_of(option)) read.push_back(field);
  for (const std::string& field : read) {
    text += '\0' + field + std::to_string(done.source.hash);
    if (const StepRecord* record = find_step(done, field))
      for (const FileStamp& output : record->outputs) text += '\0' + std::to_string(output.hash);
  }
  return hash_bytes(text);
}

bool stands(StepRecord& record) {
  for (FileStamp& output : record.outputs) {
    const auto now = stamp(output.path, &output);
    if (!now || now->hash != output.hash) return false;
    output = *now;
  }
  return !record.outputs.empty();
}

// Files there that the batch did not write, or that have changed since.
void check_is_ours(const std::vector<std::string>& files, const StepRecord* record) {
  for (const std::string& file : files) {
    const FileStamp* ours = nullptr;
    if (record)
      for (const FileStamp& output : record->outputs)
        if (output.path == file) ours = &output;
    const auto now = stamp(file, ours);
    if (now && !(ours && now->hash == ours->hash))
      throw Error(ErrorKind::kFailure, file,
                  ours ? "has changed since the batch wrote it" : "exists, and this batch has not written it",
                  Remedy::kOverwrite);
  }
}

// The stage's last line, without "rbvh STAGE: "; and its warnings, counted.
std::string last_line(const std::string& path, const std::string& stage, std::uint64_t& warnings) {
  std::ifstream in(path);
  std::string line, last;
  const std::string who = "rbvh " + stage + ": ";
  while (std::getline(in, line)) {
    if (line.starts_with(who + "warning: ")) ++warnings;
    if (!line.empty()) last = line.starts_with(who) ? line.substr(who.size()) : line;
  }
  return last;
}

nlohmann::ordered_json levels_in(const std::string& report) {
  std::error_code code;
  if (!fs::exists(report, code)) return nullptr;
  const InputBytes bytes = read_input(report);
  const nlohmann::json json = parse_shallow_json(bytes.view(), 32);
  return json.is_object() && json.contains("levels") ? nlohmann::ordered_json(json["levels"]) : nullptr;
}

struct StepFailed {
  std::string step, line;
  int code;
};

StepRecord run_step(const Work& work, const ChainStep& step, std::vector<std::string> words,
                    std::uint64_t key) {
  const std::string output = output_path(work, step), own = work.base + "." + step.name;
  make_folder_of(output);
  // Before the file's name, which follows "--".
  std::vector<std::string> given{"--threads",  std::to_string(work.threads),
                                 "--memory",   std::to_string(work.memory),
                                 "--progress", "none"};
  if (!prints(step)) given.push_back("--force");
  if (reports(step)) given.insert(given.end(), {"--report", own + ".report.json"});
  if (!work.config.device.empty() && uses_device(step))
    given.insert(given.end(), {"--device", work.config.device});
  words.insert(words.begin() + 1, given.begin(), given.end());
  // What is printed gets its name when it is whole.
  const std::string printed = prints(step) ? own + ".out" : "/dev/null", log = own + ".log";
  const ToolResult result = run_tool(words, printed, log);
  StepRecord record{.step = step.name,
                    .key = key,
                    .outputs = {},
                    .seconds = result.seconds,
                    .peak_bytes = result.peak_bytes,
                    .warnings = 0,
                    .levels = nullptr};
  const std::string line = last_line(log, step.stage, record.warnings);
  if (result.code != 0) {
    throw StepFailed{step.name,
                     result.code > 128 ? "was ended by signal " + std::to_string(result.code - 128) : line,
                     result.code};
  }
  if (prints(step))
    if (const int error = rename_file(printed, output, true); error != 0)
      fail_output(output, "cannot be written", error);
  for (const std::string& file : written_files(output))
    if (const auto found = stamp(file)) record.outputs.push_back(*found);
  if (reports(step)) record.levels = levels_in(own + ".report.json");
  return record;
}

// One process at a time works on a scan.
void lock_scan(const Descriptor& lock, const std::string& path) {
  if (lock.fd < 0) fail_output(path, "cannot be written", errno);
  if (::flock(lock.fd, LOCK_EX | LOCK_NB) != 0)
    throw Error(ErrorKind::kFailure, path, "another batch is at work on this scan");
}

void run_steps(Work& work, const Chain& chain, ScanResult& result) {
  const std::string journal_path = work.base + ".json";
  Journal before = read_journal(journal_path);
  const auto source = stamp(work.scan.path, &before.source);
  if (!source) throw Error(ErrorKind::kInput, work.scan.path, "there is no such file");
  result.journal = {*source, {}};
  result.state = State::kUpToDate;
  for (const ChainStep& step : chain.steps) {
    const std::vector<std::string> words = words_of(work, step);
    const std::uint64_t key = key_of(work, words, step, result.journal);
    const StepRecord* old = find_step(before, step.name);
    StepRecord record = old ? *old : StepRecord{};
    const bool reads_parts = step.input == "{source}" && has_parts(work.scan.path);
    if (!old || old->key != key || reads_parts || !stands(record)) {
      if (!work.config.force) check_is_ours(written_files(output_path(work, step)), old);
      record = run_step(work, step, words, key);
      result.state = State::kDone;
      result.seconds += record.seconds;
    }
    result.journal.steps.push_back(record);
    work.values[step.name] = output_path(work, step);
    if (result.state == State::kDone) {
      // Steps to come keep their records, by which their old outputs are known as ours.
      Journal stored = result.journal;
      for (const StepRecord& later : before.steps)
        if (!find_step(stored, later.step)) stored.steps.push_back(later);
      write_journal(journal_path, stored);
    }
  }
}

ScanResult run_scan(const Chain& chain, const BatchScan& scan, const BatchConfig& config,
                    const OptionFiles& option_files, int threads, std::uint64_t memory) {
  ScanResult result{.scan = scan, .error = {}, .failed_step = {}, .journal = {}};
  Work work{config,
            option_files,
            scan,
            (fs::path(config.output) / ".rbvh-batch" / scan.name).string(),
            {{"name", scan.name}, {"source", scan.path}},
            threads,
            memory};
  try {
    make_folder_of(work.base);
    const std::string lock_path = work.base + ".lock";
    const Descriptor lock{::open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)};
    lock_scan(lock, lock_path);
    run_steps(work, chain, result);
  } catch (const StepFailed& failed) {
    result.state = State::kFailed;
    result.failed_step = failed.step;
    result.error = Error(ErrorKind::kFailure, scan.path, failed.step + ": " + failed.line);
    result.exit_code = failed.code;
  } catch (const Error& error) {
    result.state = State::kFailed;
    result.error = error;
  }
  return result;
}

}  // namespace

void check_outputs_differ(const Chain& chain, const std::vector<BatchScan>& scans,
                          const std::string& folder) {
  std::map<std::string, std::string> owners;
  for (const BatchScan& scan : scans) owners[fs::weakly_canonical(scan.path).string()] = scan.path;
  for (const BatchScan& scan : scans)
    for (const ChainStep& step : chain.steps) {
      const std::string output = output_path(folder, scan, step);
      const auto [owner, is_new] = owners.try_emplace(output, scan.path);
      if (!is_new)
        throw Error(ErrorKind::kUsage, scan.path,
                    "step '" + step.name + "' would write " + output + ", which is " +
                        (owner->second == scan.path ? "the scan or another step's" : "of " + owner->second) +
                        "; give another folder or another \"output\"");
    }
}

std::vector<ScanResult> run_batch(const Chain& chain, const std::vector<BatchScan>& scans,
                                  const BatchConfig& config,
                                  const std::function<void(const ScanResult&, std::size_t done)>& on_done) {
  const OptionFiles option_files = find_option_files(chain);
  std::vector<ScanResult> results(scans.size());
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::size_t done = 0;
  const auto finish = [&](std::size_t i, ScanResult result) {
    const std::lock_guard lock(mutex);
    results[i] = std::move(result);
    on_done(results[i], ++done);
  };
  std::vector<std::size_t> too_large;
  const int jobs = std::max(1, std::min(config.jobs, static_cast<int>(scans.size())));
  const int threads = std::max(1, config.threads / jobs);
  const std::uint64_t memory = config.memory / static_cast<std::uint64_t>(jobs);
  const auto work = [&] {
    for (std::size_t i = next++; i < scans.size(); i = next++) {
      ScanResult result = run_scan(chain, scans[i], config, option_files, threads, memory);
      if (result.exit_code == kOverBudget && jobs > 1) {
        const std::lock_guard lock(mutex);
        too_large.push_back(i);
      } else {
        finish(i, std::move(result));
      }
    }
  };
  std::vector<std::thread> workers;
  workers.reserve(static_cast<std::size_t>(jobs));
  for (int job = 0; job < jobs; ++job) workers.emplace_back(work);
  for (std::thread& worker : workers) worker.join();
  std::sort(too_large.begin(), too_large.end());
  for (const std::size_t i : too_large)
    finish(i, run_scan(chain, scans[i], config, option_files, config.threads, config.memory));
  return results;
}

}  // namespace rbvh
