// Outputs are whole or absent: written under a temporary name, synced, renamed. The names of unfinished files
// are in fixed storage, because the signal handler that removes them may neither allocate nor lock.
#include "io/output_file.h"

#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <set>
#include <vector>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

// --- what an interrupt removes

struct Slot {
  bool used;
  char path[PATH_MAX];
};
std::array<Slot, 64> g_unfinished;  // far more than any stage has open at once
std::mutex g_mutex;                 // orders the threads that change g_unfinished
std::atomic<int> g_critical{0};     // threads between two states that the handler must not see
std::atomic<bool> g_exiting{false};
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

sigset_t interrupt_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, signal);
  return set;
}

// While one exists, the handler does not run on this thread and waits on the others.
class HoldInterrupts {
 public:
  HoldInterrupts() {
    const sigset_t set = interrupt_signals();
    pthread_sigmask(SIG_BLOCK, &set, &old_);
    g_critical.fetch_add(1);
    if (g_exiting) {  // another thread is in the handler: create and rename nothing more
      g_critical.fetch_sub(1);
      for (;;) pause();
    }
  }
  ~HoldInterrupts() {
    g_critical.fetch_sub(1);
    pthread_sigmask(SIG_SETMASK, &old_, nullptr);
  }
  HoldInterrupts(const HoldInterrupts&) = delete;
  HoldInterrupts& operator=(const HoldInterrupts&) = delete;

 private:
  sigset_t old_;
};

extern "C" void remove_unfinished_and_exit(int) {
  g_exiting = true;
  while (g_critical > 0) poll(nullptr, 0, 1);
  for (const Slot& slot : g_unfinished)
    if (slot.used) unlink(slot.path);
  _exit(128 + SIGINT);  // as shells have it
}

// Both are called with interrupts held.
void add_unfinished(const std::string& path) {
  const std::lock_guard lock(g_mutex);
  for (Slot& slot : g_unfinished)
    if (!slot.used) {
      path.copy(slot.path, path.size());
      slot.path[path.size()] = '\0';
      slot.used = true;
      return;
    }
  RBVH_CHECK(false && "more unfinished outputs at once than there are slots");
}

void drop_unfinished(const std::string& path) {
  const std::lock_guard lock(g_mutex);
  for (Slot& slot : g_unfinished)
    if (slot.used && path == slot.path) slot.used = false;
}

// --- files

std::string shown(const std::string& path) { return path == "-" ? "standard output" : path; }

[[noreturn]] void fail(const std::string& path, const std::string& what, int error) {
  while (g_exiting) pause();  // the handler took the file away on another thread: it exits, with its own code
  throw Error(ErrorKind::kFailure, shown(path), what + ": " + std::strerror(error));
}

// Closes on every way out; close() is where some file systems report a full disk.
struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
  int close() {
    const int result = ::close(fd);
    fd = -1;
    return result;
  }
};

// 0, or errno.
int write_fully(int fd, const char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t n = ::write(fd, data, size);
    if (n >= 0) {
      data += n;
      size -= static_cast<std::size_t>(n);
    } else if (errno == EAGAIN) {  // standard output may be non-blocking
      pollfd wait{fd, POLLOUT, 0};
      poll(&wait, 1, -1);
    } else if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

std::string folder_of(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

// Names of open descriptors. Even where one is a regular file, we write to it and do not replace it.
bool names_descriptor(const std::string& path) {
  return path == "-" || path == "/dev/stdout" || path == "/dev/stderr" || path.starts_with("/dev/fd/") ||
         path.starts_with("/proc/");
}

// ".<stem>.tmp.<pid>[.<attempt>]<extension>" in `folder`, the stem cut so that the name stays legal.
std::string temporary_name(const std::string& folder, const std::string& path, int attempt) {
  const std::filesystem::path name = std::filesystem::path(path).filename();
  std::string end = ".tmp." + std::to_string(getpid());
  if (attempt > 0) end.append(".").append(std::to_string(attempt));
  end += name.extension().string();
  std::string full = ".";
  full += name.stem().string();
  if (full.size() + end.size() > NAME_MAX)
    full.resize(NAME_MAX - std::min<std::size_t>(NAME_MAX - 1, end.size()));
  return (std::filesystem::path(folder) / (full + end)).string();
}

// Creates a new file, never through an existing link, and registers it for removal.
std::string create_temporary(const std::string& folder, const std::string& path) {
  for (int attempt = 0;; ++attempt) {
    std::string name = temporary_name(folder, path, attempt);
    if (name.size() >= PATH_MAX) fail(path, "cannot be created", ENAMETOOLONG);
    const HoldInterrupts hold;
    const Descriptor file{::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666)};
    if (file.fd >= 0) {
      add_unfinished(name);
      return name;
    }
    if (errno == EEXIST && attempt < 1000) continue;
    const int error = errno;
    if (error == ENOTDIR) fail(path, "cannot be created, as part of its path is no folder", error);
    if (error == ENOENT) check_folder(path, folder);
    fail(path, "cannot be created", error);
  }
}

// EINVAL: a file system that cannot sync this kind of file, which is no reason to lose the output. EACCES: a
// folder that we may write to but not read.
void sync_path(const std::string& path, const std::string& shown_path) {
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.fd < 0 && errno == EACCES) return;
  if (file.fd < 0 || (fsync(file.fd) != 0 && errno != EINVAL))
    fail(shown_path, "cannot be synced to disk", errno);
}

void copy_to_special(const std::string& temporary, const std::string& path) {
  const Descriptor from{::open(temporary.c_str(), O_RDONLY | O_CLOEXEC)};
  if (from.fd < 0) fail(path, "cannot be written", errno);
  Descriptor own{path == "-" ? -1 : ::open(path.c_str(), O_WRONLY | O_CLOEXEC)};
  if (path != "-" && own.fd < 0) fail(path, "cannot be opened for writing", errno);
  const int to = path == "-" ? STDOUT_FILENO : own.fd;
  std::vector<char> block(1 << 16);
  for (;;) {
    const ssize_t n = ::read(from.fd, block.data(), block.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path, "cannot be written", errno);
    if (n == 0) break;
    if (const int error = write_fully(to, block.data(), static_cast<std::size_t>(n)))
      fail(path, "cannot be written", error);
  }
  if (own.fd >= 0 && own.close() != 0) fail(path, "cannot be written", errno);
}

// 0, or errno; without `replace`, a file that has appeared since we looked is EEXIST.
int rename_to(const std::string& from, const std::string& to, bool replace) {
  if (!replace) {
    if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS) return errno;
    if (access(to.c_str(), F_OK) == 0) return EEXIST;  // a file system without that flag
  }
  return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

[[noreturn]] void refuse_existing(const std::string& path) {
  throw Error(ErrorKind::kFailure, path, "exists already", Remedy::kOverwrite);
}

}  // namespace

OutputFile::OutputFile(const std::string& path, bool overwrite)
    : path_(path), target_(path), overwrite_(overwrite) {
  if (path.empty()) throw Error(ErrorKind::kFailure, "", "an output has an empty name; give it one");
  struct stat status {};
  const bool exists = path != "-" && ::stat(path.c_str(), &status) == 0;
  if (!exists && path != "-" && errno != ENOENT && errno != ENOTDIR) fail(path, "cannot be created", errno);
  if (exists && S_ISDIR(status.st_mode))
    throw Error(ErrorKind::kFailure, path, "is a folder; give a file's name");
  is_special_ = names_descriptor(path) || (exists && !S_ISREG(status.st_mode));
  if (is_special_) {
    if (path != "-" && access(path.c_str(), W_OK) != 0) fail(path, "cannot be written", errno);
    std::error_code ignored;
    const std::filesystem::path folder = std::filesystem::temp_directory_path(ignored);
    temporary_ = create_temporary(ignored ? "/tmp" : folder.string(), path == "-" ? "stdout" : path);
    return;
  }
  if (exists && !overwrite) refuse_existing(path);
  if (exists) {
    std::array<char, PATH_MAX> real;
    if (realpath(path.c_str(), real.data()) == nullptr) fail(path, "cannot be replaced", errno);
    target_ = real.data();
  }
  temporary_ = create_temporary(folder_of(target_), target_);
}

OutputFile::~OutputFile() {
  if (committed_) return;
  const HoldInterrupts hold;
  unlink(temporary_.c_str());
  drop_unfinished(temporary_);
}

void OutputFile::write(std::span<const std::byte> bytes) {
  Descriptor file{::open(temporary_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC)};
  if (file.fd < 0) fail(path_, "cannot be written", errno);
  if (const int error = write_fully(file.fd, reinterpret_cast<const char*>(bytes.data()), bytes.size()))
    fail(path_, "cannot be written", error);
  if (file.close() != 0) fail(path_, "cannot be written", errno);
}

void OutputFile::write(std::string_view text) { write(std::as_bytes(std::span(text))); }

void OutputFile::commit() {
  OutputFile* const self = this;
  commit_all({&self, 1});
}

void commit_all(std::span<OutputFile* const> files) {
  for (const OutputFile* file : files) {
    RBVH_CHECK(!file->committed_);
    if (!file->is_special_) sync_path(file->temporary_, file->path_);
  }
  // Outside of the held section: a pipe may block for ever, and Ctrl-C must end that.
  for (const OutputFile* file : files)
    if (file->is_special_) copy_to_special(file->temporary_, file->path_);

  const HoldInterrupts hold;
  for (OutputFile* file : files) {
    if (file->is_special_) {
      unlink(file->temporary_.c_str());
    } else {
      // Best effort: the new file gets the old one's mode.
      struct stat old {};
      if (file->overwrite_ && ::stat(file->target_.c_str(), &old) == 0)
        static_cast<void>(!chmod(file->temporary_.c_str(), old.st_mode & 07777));
      const int error = rename_to(file->temporary_, file->target_, file->overwrite_);
      if (error == EEXIST) refuse_existing(file->path_);
      if (error != 0) fail(file->path_, "cannot be moved into place", error);
    }
    file->committed_ = true;
    drop_unfinished(file->temporary_);
    // Each rename reaches the disk before the next: a pair depends on their order.
    if (!file->is_special_) sync_path(folder_of(file->target_), file->path_);
  }
}

void install_interrupt_cleanup() {
  struct sigaction action {};
  action.sa_handler = remove_unfinished_and_exit;
  sigfillset(&action.sa_mask);
  // SIGINT and SIGTERM even where they were ignored (a script's background job): one that
  // arrives was sent on purpose.
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction hangup {};
  sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);  // nohup stays nohup
  struct sigaction ignore {};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &ignore, nullptr);
  sigaction(SIGXFSZ, &ignore, nullptr);
}

void check_folder(const std::string& path, const std::string& folder) {
  struct stat status {};
  if (::stat(folder.c_str(), &status) != 0)
    throw Error(ErrorKind::kFailure, path,
                "cannot be created: there is no folder " + folder + "; make it first");
}

void check_paths_differ(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs) {
  std::set<std::filesystem::path> taken;
  const auto resolve = [](const std::string& path) {
    std::error_code error;
    const auto whole = std::filesystem::weakly_canonical(path, error);
    return error ? std::filesystem::path(path) : whole;
  };
  if (std::count(inputs.begin(), inputs.end(), "-") > 1)
    throw Error(ErrorKind::kUsage, "", "standard input can be one input only; name files");
  for (const std::string& input : inputs)
    if (input != "-") taken.insert(resolve(input));
  for (const std::string& output : outputs) {
    // Devices (/dev/null) can be named twice.
    std::error_code error;
    if (output.empty() || output == "-" || std::filesystem::is_character_file(output, error)) continue;
    if (!taken.insert(resolve(output)).second)
      throw Error(ErrorKind::kUsage, output,
                  "is named twice, to be written and read or written; choose another name");
  }
}

void check_output(const std::string& path, bool overwrite) { const OutputFile probe(path, overwrite); }

}  // namespace rbvh
