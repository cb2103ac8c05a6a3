#include "cli/common.h"

#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "io/output_file.h"
#include "io/report_json.h"
#include "pipeline/base/parallel_for.h"
#include "rbvh/io.h"

namespace rbvh {
namespace {

bool g_log_failed = false;

constexpr std::pair<std::string_view, ProgressMode> kProgressModes[] = {{"auto", ProgressMode::kAuto},
                                                                        {"bar", ProgressMode::kBar},
                                                                        {"plain", ProgressMode::kPlain},
                                                                        {"json", ProgressMode::kJson},
                                                                        {"none", ProgressMode::kNone}};

/// Names out of a file may be no UTF-8.
std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

void open_log(const Context& context) {
  const std::string folder = std::filesystem::path(context.log_path).parent_path().string();
  if (!folder.empty()) check_folder(context.log_path, folder);  // spdlog would make it
  try {
    const auto logger = spdlog::basic_logger_mt("file", context.log_path);
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e %l " + context.stage + ": %v");
    logger->set_level(spdlog::level::debug);
    logger->flush_on(spdlog::level::debug);
    logger->set_error_handler([](const std::string&) { g_log_failed = true; });
  } catch (const spdlog::spdlog_ex&) {
    throw Error(ErrorKind::kFailure, context.log_path, "the log cannot be written; choose another name");
  }
}

void to_log(spdlog::level::level_enum level, const std::string& line) {
  if (const auto logger = spdlog::get("file")) logger->log(level, line);
}

bool use_color(const Context& context) {
  const char* no_color = std::getenv("NO_COLOR");
  return !context.no_color && !(no_color && *no_color) && isatty(STDERR_FILENO);
}

constexpr int kMostThreads = 256;

void begin_stage(Context& context) {
  context.stage_watch = context.phase_watch = {};
  if (!context.report_path.empty()) check_output(context.report_path, context.force);
  if (!context.log_path.empty()) open_log(context);
  // More than the system can start would abort within PoCL.
  if (context.threads > 0)
    set_thread_count(std::min(context.threads, kMostThreads));  // PoCL's too: see list_devices()
  context.progress.start(context.quiet ? ProgressMode::kNone : context.progress_mode, context.stage,
                         use_color(context));
  set_compile_notice([&context](std::string_view line) {
    note(context, "rbvh " + context.stage + ": " + std::string(line));
  });
  set_output_warning([&context](std::string_view line) { warn(context, std::string(line)); });
  set_build_log_sink([&context](std::string_view file, std::string_view log) {
    detail(context, "rbvh " + context.stage + ": building " + std::string(file) + ": " + std::string(log));
  });
  context.report = {{"stage", context.stage}, {"version", RBVH_VERSION}};
}

void write_report(Context& context) {
  context.report["timings"]["total"] = context.stage_watch.lap();
  OutputFile file(context.report_path, context.force);
  file.write(json_text(context.report));
  file.commit();
}

void end_stage(Context& context) {
  context.progress.finish();
  if (g_log_failed)
    throw Error(ErrorKind::kFailure, context.log_path, "the log could not be written to its end");
  if (context.report_path.empty()) return;
  write_report(context);
}

}  // namespace

void check_paths_differ(Context& context, const std::vector<std::string>& inputs,
                        std::vector<std::string> outputs) {
  for (const std::string& path : inputs)
    if (path.size() == 2 && path[0] == 'Q' && path[1] >= '0' && path[1] <= '9' &&
        !std::filesystem::exists(path))
      throw Error(ErrorKind::kUsage, path, "is no file; levels have commas between, as in --level Q3,Q4");
  outputs.push_back(context.report_path);
  outputs.push_back(context.log_path);
  check_paths_differ(inputs, outputs);
  context.paths_differ = true;
}

std::string parse_path(std::string_view text) {
  if (text.empty()) throw Error(ErrorKind::kUsage, "", "the name is empty");
  return std::string(text);
}

CLI::App* add_stage(CLI::App& app, Context& context, const StageText& text, unsigned common_options,
                    std::function<void()> work) {
  CLI::App* stage = app.add_subcommand(text.name, text.summary);
  stage->footer("Example: " + text.example);
  const auto group = [](CLI::Option* option) { option->group("Common options"); };
  if (common_options & kWithOutput) {
    group(add_parsed(*stage, "-o,--output", context.output, parse_path, "FILE", "what to write")->required());
  }
  if (common_options & (kWithOutput | kWithReport))
    group(stage->add_flag("-f,--force", context.force, "overwrite what is there"));
  if (common_options & kWithDevice)
    group(stage
              ->add_option("--device", context.device,
                           "OpenCL device: cpu, gpu, an index or part of a name of `rbvh devices` (default: "
                           "RBVH_DEVICE, else the first CPU)")
              ->type_name("NAME"));
  if (common_options & kWithReport)
    group(add_parsed(*stage, "--report", context.report_path, parse_path, "FILE",
                     "write timings, counts, bytes, device and version as JSON"));
  group(stage->add_flag("-q,--quiet", context.quiet, "say nothing but errors"));
  group(stage->add_flag("-v,--verbose", context.verbose, "say more"));
  group(add_parsed(*stage, "--log", context.log_path, parse_path, "FILE", "append all messages, with times"));
  group(add_parsed(*stage, "--threads", context.threads, parse_positive, "N", "host threads (default: all)"));
  group(add_parsed(*stage, "--memory", context.memory.bytes, parse_bytes, "SIZE",
                   "give up (exit 5) rather than need more, e.g. 2G (default: what the machine has)"));
  group(stage->add_flag("--no-color", context.no_color, "no colours on a terminal (as NO_COLOR)"));
  group(add_parsed(*stage, "--progress", context.progress_mode, parse_choice<kProgressModes>, "HOW",
                   "auto, bar, plain, json or none"));
  stage->callback([&context, work = std::move(work), name = text.name] {
    context.stage = name;
    begin_stage(context);
    work();
    end_stage(context);
  });
  return stage;
}

void refuse_options(const std::vector<const CLI::Option*>& options, const std::string& file,
                    const std::string& why) {
  for (const CLI::Option* option : options)
    if (option->count() > 0) throw Error(ErrorKind::kUsage, file, option->get_name() + " " + why);
}

void print_data(std::string_view text) { std::fwrite(text.data(), 1, text.size(), stdout); }

void print_json(const nlohmann::ordered_json& json) { print_data(json_text(json)); }

void note(Context& context, const std::string& text) {
  const std::string line = one_line(text);
  if (!context.quiet) context.progress.print_line(line);
  to_log(spdlog::level::info, line);
}

void detail(Context& context, const std::string& text) {
  const std::string line = one_line(text);
  if (context.verbose && !context.quiet) context.progress.print_line(line);
  to_log(spdlog::level::debug, line);
}

void warn(Context& context, const std::string& text) {
  const std::string line = one_line(text);
  if (!context.quiet) {
    const bool color = use_color(context);
    context.progress.print_line("rbvh " + context.stage + ": " +
                                (color ? "\033[33mwarning:\033[0m " : "warning: ") + line);
  }
  to_log(spdlog::level::warn, line);
}

void print_error(Context& context, const std::string& line) {
  context.progress.abandon();
  const std::string who = context.stage.empty() ? "rbvh:" : "rbvh " + context.stage + ":";
  context.progress.print_line((use_color(context) ? "\033[31m" + who + "\033[0m " : who + " ") + line);
  to_log(spdlog::level::err, line);
}

void report_failure(Context& context, const std::string& line, int exit_code) {
  if (context.report_path.empty() || !context.paths_differ) return;
  context.report["error"] = line;
  context.report["exit_code"] = exit_code;
  try {
    write_report(context);
  } catch (const Error&) {  // the failure itself has been said
  }
}

double time_phase(Context& context, const std::string& name) {
  const double seconds = context.phase_watch.lap();
  add_time(context, name, seconds);
  return seconds;
}

void add_time(Context& context, std::string_view phase, double seconds) {
  nlohmann::ordered_json& timing = context.report["timings"][std::string(phase)];
  timing = timing.is_null() ? seconds : timing.get<double>() + seconds;
}

Device open_device(Context& context) {
  Device device = Device::open(context.device);
  report_device(context, device);
  return device;
}

void report_device(Context& context, const Device& device) {
  context.report["device"] = device_json(device.info());
}

double mrays_per_second(std::uint64_t rays, double seconds) {
  return seconds > 0 ? static_cast<double>(rays) / seconds / 1e6 : 0;
}

}  // namespace rbvh
