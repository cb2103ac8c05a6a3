// What all stages of the command line share: their common options, their messages, their reports.
//
// A stage is a file cli/<stage>.cpp with one function add_<stage>, which declares the stage's own options and
// hands add_stage() the work:
//
//   add_stage(app, context, {"info", "Say what a file holds", "rbvh info dragon.rbvh"}, 0,
//             [&context, options] { run_info(context, *options); });
//
// The work throws rbvh::Error; main prints it as the one line "rbvh <stage>: ...". Data goes to stdout by
// print_data(), everything else to stderr by note(), detail() and warn().
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "cli/progress.h"
#include "pipeline/base/error.h"
#include "pipeline/base/memory_budget.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/base/words.h"
#include "pipeline/device/device.h"

namespace rbvh {

/// The common options' values, and what the running stage writes to.
struct Context {
  std::string stage;  ///< its name; empty before one is chosen
  std::string output;
  bool force = false;
  bool quiet = false;
  bool verbose = false;
  std::string log_path;
  std::string device;  ///< as Device::open() takes it
  int threads = 0;     ///< 0: all
  MemoryBudget memory;
  bool no_color = false;
  ProgressMode progress_mode = ProgressMode::kAuto;
  std::string report_path;
  bool paths_differ = false;  ///< checked: the report overwrites neither input nor output

  ProgressReporter progress;
  nlohmann::ordered_json report;  ///< for --report: a stage adds counts, timings, bytes
  Stopwatch stage_watch;          ///< since the stage began
  Stopwatch phase_watch;          ///< since the last time_phase()
};

struct StageText {
  std::string name;
  std::string summary;  ///< one line
  std::string example;  ///< one command
};

/// Common options beside the ones every stage has (-q -v --log --threads --memory --no-color --progress).
enum CommonOption : unsigned {
  kWithOutput = 1,  ///< -o/--output (required) and -f/--force
  kWithDevice = 2,  ///< --device
  kWithReport = 4,  ///< --report
};

/// The same of outputs, report and log.
void check_paths_differ(Context& context, const std::vector<std::string>& inputs,
                        std::vector<std::string> outputs);

/// Declares a stage. `work` runs after all options have been read, with threads, log and progress set up.
CLI::App* add_stage(CLI::App& app, Context& context, const StageText& text, unsigned common_options,
                    std::function<void()> work);

/// The same of a stage that has options of its own.
template <class Options>
std::pair<CLI::App*, std::shared_ptr<Options>> add_stage(CLI::App& app, Context& context,
                                                         const StageText& text, unsigned common_options,
                                                         void (*run)(Context&, const Options&)) {
  const auto options = std::make_shared<Options>();
  CLI::App* stage =
      add_stage(app, context, text, common_options, [&context, options, run] { run(context, *options); });
  return {stage, options};
}

/// An option with one value, read by one of pipeline/base/words.h's functions (or its like). The target may
/// be std::optional.
template <class Target, class Value>
CLI::Option* add_parsed(CLI::App& stage, const std::string& name, Target& target,
                        Value (*parse)(std::string_view), const std::string& value_name,
                        const std::string& help) {
  return stage
      .add_option_function<std::string>(
          name,
          [name, &target, parse](const std::string& text) {
            try {
              target = parse(text);
            } catch (const Error& error) {
              throw Error(ErrorKind::kUsage, "", name.substr(name.rfind(',') + 1) + ": " + error.what(),
                          error.remedy());
            }
          },
          help)
      ->type_name(value_name);
}

/// The name of a file, which is not empty.
std::string parse_path(std::string_view text);

/// Throws Error(kUsage) where one of the options was given: "FILE: --option is for ...".
void refuse_options(const std::vector<const CLI::Option*>& options, const std::string& file,
                    const std::string& why);

/// To stdout.
void print_data(std::string_view text);
void print_json(const nlohmann::ordered_json& json);
/// One line to stderr (and the log), unless --quiet.
void note(Context& context, const std::string& text);
/// One line to stderr with --verbose; always to the log.
void detail(Context& context, const std::string& text);
/// One line "rbvh <stage>: warning: ..." to stderr, unless --quiet.
void warn(Context& context, const std::string& text);
/// The one line of an error, to stderr and the log.
void print_error(Context& context, const std::string& line);

/// Writes what --report asked for with the keys error and exit_code, where the stage had begun and its paths
/// differ.
void report_failure(Context& context, const std::string& line, int exit_code);

/// Adds the seconds since the last call, or since the stage began, to the report's timing of that name.
/// Returns them.
double time_phase(Context& context, const std::string& name);
/// The same of a phase that was timed elsewhere.
void add_time(Context& context, std::string_view phase, double seconds);

/// Device::open() by --device; the report names it.
Device open_device(Context& context);
void report_device(Context& context, const Device& device);

/// Million rays per second, for reports; 0 where no time passed.
double mrays_per_second(std::uint64_t rays, double seconds);

}  // namespace rbvh
