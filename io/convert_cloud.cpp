#include "io/convert_cloud.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>

#include "io/max_expansion.h"
#include "pipeline/base/error.h"

extern char** environ;

namespace rbvh {
namespace {

/// Of a pair of connected sockets, ours and the child's: they give no SIGPIPE, as pipes would.
struct Channel {
  int ours = -1, theirs = -1;

  Channel() {
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
      throw Error(ErrorKind::kFailure, "", "too many files are open");
    ours = ends[0];
    theirs = ends[1];
  }
  ~Channel() {
    close_end(ours);
    close_end(theirs);
  }
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;
  static void close_end(int& end) {
    if (end >= 0) close(end);
    end = -1;
  }
};

struct Child {
  Channel in, out, errors;
  pid_t id = -1;

  /// `rbvh-convert KIND`; an errno where there is none.
  int start(const std::string& kind) {
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, in.theirs, 0);
    posix_spawn_file_actions_adddup2(&actions, out.theirs, 1);
    posix_spawn_file_actions_adddup2(&actions, errors.theirs, 2);
    std::string program = "rbvh-convert", word = kind;
    const std::array<char*, 3> words = {program.data(), word.data(), nullptr};
    const int failed = posix_spawnp(&id, program.c_str(), &actions, nullptr, words.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    for (Channel* channel : {&in, &out, &errors}) Channel::close_end(channel->theirs);
    return failed;
  }

  /// Appends what there is; closes the channel at its end.
  static void read_some(int& end, std::string& to) {
    std::array<char, 1 << 16> bytes;
    const ssize_t count = read(end, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) return;
    if (count > 0)
      to.append(bytes.data(), static_cast<std::size_t>(count));
    else
      Channel::close_end(end);
  }

  /// Writes and reads as the child wants, until it has ended its output. False: that is over `most` bytes.
  bool exchange(std::string_view bytes, std::string& output, std::string& said, std::uint64_t most) {
    while (out.ours >= 0 || errors.ours >= 0) {
      std::array<pollfd, 3> ends = {
          pollfd{in.ours, POLLOUT, 0}, {out.ours, POLLIN, 0}, {errors.ours, POLLIN, 0}};
      if (poll(ends.data(), ends.size(), -1) < 0 && errno != EINTR) return false;
      if (ends[0].revents != 0) {
        const ssize_t sent = send(in.ours, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent > 0) bytes.remove_prefix(static_cast<std::size_t>(sent));
        // A child that reads no further has its reasons.
        if (bytes.empty() || (sent < 0 && errno != EAGAIN && errno != EINTR)) Channel::close_end(in.ours);
      }
      if (ends[1].revents != 0) read_some(out.ours, output);
      if (ends[2].revents != 0) read_some(errors.ours, said);
      if (output.size() > most) return false;
    }
    return true;
  }

  int wait() const {
    int status = 0;
    while (waitpid(id, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
  }
};

}  // namespace

std::string convert_cloud(std::string_view bytes, const std::string& kind, const std::string& file) {
  Child child;
  if (child.start(kind) != 0)
    throw Error(ErrorKind::kInput, file,
                std::string(kind == "laz" ? "is compressed (LAZ or COPC)" : "is an E57 file") +
                    ", which rbvh-convert reads, and that is not on the PATH (`npm install -g tools/convert` "
                    "brings it); or convert it to " +
                    (kind == "laz" ? "LAS" : "PLY"));
  std::string output, said;
  const std::uint64_t most = kMaxExpansion * bytes.size();
  const bool is_whole = child.exchange(bytes, output, said, most);
  if (!is_whole) kill(child.id, SIGKILL);
  const int status = child.wait();
  if (!is_whole)
    throw Error(ErrorKind::kInput, file,
                "becomes more than " + std::to_string(kMaxExpansion) + " times its size; is it damaged?");
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    said = said.substr(0, said.find('\n'));
    throw Error(ErrorKind::kInput, file, "rbvh-convert fails: " + (said.empty() ? "it says nothing" : said));
  }
  return output;
}

}  // namespace rbvh
