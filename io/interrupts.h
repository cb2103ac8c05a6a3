// What an interrupt does to outputs: those that are unfinished are removed.
#pragma once

#include <signal.h>

#include <string>

namespace rbvh {

/// SIGINT, SIGTERM and SIGHUP remove every unfinished file and exit with 130; exit() removes them, too. A
/// broken pipe and a file size limit become write errors instead of signals. Called once by main.
void install_interrupt_cleanup();

/// While one exists, the handler does not run on this thread and waits on the others.
class HoldInterrupts {
 public:
  HoldInterrupts();
  ~HoldInterrupts();
  HoldInterrupts(const HoldInterrupts&) = delete;
  HoldInterrupts& operator=(const HoldInterrupts&) = delete;

 private:
  sigset_t old_;
};

/// Both are called with interrupts held. `path` is shorter than PATH_MAX.
void add_unfinished(const std::string& path);
void drop_unfinished(const std::string& path);

/// Never returns once the handler runs on another thread: files may vanish then, and it ends the process.
/// With interrupts held it waits for us, and this returns.
void stop_where_exiting();

}  // namespace rbvh
