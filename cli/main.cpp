// The command line's entry: reads the words, runs one stage, and turns every failure into one line and an
// exit code.
#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include "cli/common.h"
#include "cli/exit_code.h"
#include "cli/remedies.h"
#include "cli/stages.h"
#include "io/interrupts.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

// A closed standard stream would lend its number to the next file opened, and our messages would land in it.
// One that is closed becomes one that cannot be written to, so that lost data is still noticed.
void occupy_standard_streams() {
  for (const auto& [fd, stand_in] : {std::pair{0, "/dev/null"}, {1, "/dev/full"}, {2, "/dev/null"}}) {
    if (fcntl(fd, F_GETFD) != -1) continue;
    // Read-only where /dev/full is missing: writing fails all the same.
    if (open(stand_in, fd == 0 ? O_WRONLY : O_RDWR) < 0) open("/dev/null", O_RDONLY);
  }
}

std::string stage_names(const CLI::App& app) {
  std::string names;
  for (const CLI::App* stage : app.get_subcommands({}))
    names += (names.empty() ? "" : ", ") + stage->get_name();
  return names;
}

// Checks the first word here: what CLI11 says about it does not help.
void check_stage_word(const CLI::App& app, const char* word) {
  if (!word)
    throw Error(ErrorKind::kUsage, "", "which stage? One of " + stage_names(app) + "; see rbvh --help");
  if (std::strcmp(word, "-h") == 0 || std::strcmp(word, "--help") == 0 || std::strcmp(word, "--version") == 0)
    return;
  if (word[0] == '-')
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(word) + "': options follow the stage's name; see rbvh --help");
  if (app.get_subcommands([word](const CLI::App* stage) { return stage->get_name() == word; }).empty())
    throw Error(
        ErrorKind::kUsage, "",
        "'" + std::string(word) + "' is no stage; there are " + stage_names(app) + "; see rbvh --help");
}

void flush_stdout() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout))
    throw Error(ErrorKind::kFailure, "",
                std::string("standard output cannot be written: ") + std::strerror(errno));
}

void run(CLI::App& app, Context& context, int argc, char** argv) {
  add_ingest(app, context);
  add_build(app, context);
  add_lod(app, context);
  add_mesh(app, context);
  add_tiles(app, context);
  add_proxy(app, context);
  add_render(app, context);
  add_trace(app, context);
  add_paint(app, context);
  add_sample(app, context);
  add_bake(app, context);
  add_update(app, context);
  add_batch(app, context);
  add_info(app, context);
  add_validate(app, context);
  add_view(app, context);
  add_devices(app, context);
  std::vector<std::string> words(argv + 1, argv + argc);
  if (!words.empty() && words[0] == "help") {  // as other tools have it: help STAGE
    words.erase(words.begin());
    words.push_back("--help");
  }
  check_stage_word(app, words.empty() ? nullptr : words[0].c_str());
  if (words[0][0] != '-') context.stage = words[0];
  try {
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::CallForHelp&) {
    print_data(app.help());
  } catch (const CLI::CallForVersion&) {
    print_data("rbvh " RBVH_VERSION "\nbuilt with " RBVH_BUILT_WITH "\n");
  } catch (const CLI::Success&) {  // an option that was all that was wanted
  } catch (const CLI::ParseError& error) {
    for (const CLI::App* stage : app.get_subcommands())
      for (const std::string& word : stage->remaining())
        if (word.starts_with("-"))
          throw Error(ErrorKind::kUsage, "",
                      "'" + word + "' is no option; see rbvh " + context.stage +
                          " --help (a file's name that begins with - follows --)");
    throw Error(ErrorKind::kUsage, "",
                one_line(error.what()) + "; see rbvh " + (context.stage.empty() ? "" : context.stage + " ") +
                    "--help");
  }
  flush_stdout();
}

}  // namespace
}  // namespace rbvh

int main(int argc, char** argv) {
  using rbvh::ExitCode;
  rbvh::occupy_standard_streams();
  rbvh::install_interrupt_cleanup();
  rbvh::Context context;
  CLI::App app("Scans to rasterized bounding volume hierarchies: ingest, build, render.", "rbvh");
  app.require_subcommand(1);
  app.set_version_flag("--version", RBVH_VERSION);
  app.footer("Options follow the stage's name. Example: rbvh build scan.ply -o scan.rbvh");
  ExitCode code = ExitCode::kOk;
  std::string what;
  try {
    rbvh::run(app, context, argc, argv);
  } catch (const rbvh::Error& error) {
    code = rbvh::exit_code(error.kind());
    what = rbvh::error_line(error);
  } catch (const rbvh::BatchFailure& error) {
    code = ExitCode::kBatch;
    what = error.what();
  } catch (const std::bad_alloc&) {
    code = ExitCode::kBudget;
    what = "out of memory; free some, or ask for less";
  } catch (const std::exception& error) {
    code = ExitCode::kFailure;
    what = error.what();
  } catch (...) {
    code = ExitCode::kFailure;
    what = "unknown failure";
  }
  if (code != ExitCode::kOk) {
    std::fflush(stdout);
    rbvh::print_error(context, rbvh::one_line(what));
    rbvh::report_failure(context, rbvh::one_line(what), static_cast<int>(code));
  }
  return static_cast<int>(code);
}
