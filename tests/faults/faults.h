// For tests that link fail_syscalls.c, which says what its variables mean.
#pragma once

#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>

#include "pipeline/base/parallel_for.h"

namespace rbvh {

struct Fault {
  std::string folder = {};  ///< absolute
  int at = 0;               ///< which call; 0: none
  std::string what = {}, calls = {}, log = {};
};

extern "C" void restart_faults(void);

inline void arm(const Fault& fault) {
  const auto set = [](const char* name, const std::string& value) {
    value.empty() ? unsetenv(name) : setenv(name, value.c_str(), 1);
  };
  set("RBVH_FAULT_FOLDER", fault.folder);
  set("RBVH_FAULT_AT", fault.at > 0 ? std::to_string(fault.at) : "");
  set("RBVH_FAULT", fault.what);
  set("RBVH_FAULT_CALLS", fault.calls);
  set("RBVH_FAULT_LOG", fault.log);
  restart_faults();
}

/// Runs `body` in a child that meets `fault`; its exit code is what `body` returns.
inline pid_t start_child(const Fault& fault, const std::function<int()>& body) {
  const pid_t child = fork();
  if (child != 0) return child;
  set_thread_count(1);  // a fork has none of its parent's pools
  arm(fault);
  _exit(body());
}

/// The same in this process, for what does not end it.
inline int run_here(const Fault& fault, const std::function<int()>& body) {
  arm(fault);
  const int code = body();
  arm({});
  return code;
}

/// Its exit code, or 128 + the signal that ended it.
inline int end_of(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// Whether there was a call to meet the fault.
inline bool happened(const Fault& fault) {
  std::ifstream in(fault.log);
  const std::string log(std::istreambuf_iterator<char>(in), {});
  return log.find(" !\n") != std::string::npos;
}

}  // namespace rbvh
