#include "batch/run_tool.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

#include "io/output_file.h"
#include "io/posix_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"

namespace rbvh {
namespace {

int open_new(const std::string& path) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd < 0) fail_output(path, "cannot be written", errno);
  return fd;
}

// In the child, between fork and exec: only what is safe there beside other threads.
[[noreturn]] void become_tool(char* const* words, int in, int out, int err, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(127);  // it died before the line above
  ::dup2(in, STDIN_FILENO);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(err, STDERR_FILENO);
  ::execv("/proc/self/exe", words);
  ::_exit(127);
}

}  // namespace

ToolResult run_tool(const std::vector<std::string>& words, const std::string& stdout_path,
                    const std::string& stderr_path) {
  Descriptor in{::open("/dev/null", O_RDONLY | O_CLOEXEC)};
  Descriptor out{open_new(stdout_path)}, err{open_new(stderr_path)};
  std::string program = "rbvh";
  std::vector<char*> argv{program.data()};
  std::vector<std::string> copy = words;
  for (std::string& word : copy) argv.push_back(word.data());
  argv.push_back(nullptr);
  Stopwatch watch;
  const pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) become_tool(argv.data(), in.fd, out.fd, err.fd, parent);
  if (child < 0) fail_output("rbvh " + words[0], "cannot be started", errno);
  int status = 0;
  rusage usage{};
  while (::wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), watch.lap(),
          static_cast<std::uint64_t>(usage.ru_maxrss) * 1024};
}

}  // namespace rbvh
