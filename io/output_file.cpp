#include "io/output_file.h"

#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "io/file_set.h"
#include "io/interrupts.h"
#include "io/posix_file.h"
#include "pipeline/base/error.h"
#include "rbvh/io.h"

namespace rbvh {
namespace {

std::mutex g_warning_mutex;
std::function<void(std::string_view)> g_warning = [](std::string_view line) {
  std::fprintf(stderr, "%.*s\n", static_cast<int>(line.size()), line.data());
};

std::string shown(const std::string& path) { return path == "-" ? "standard output" : path; }

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

// Names of open descriptors. Even where one is a regular file, we write to it and do not replace it.
bool names_descriptor(const std::string& path) {
  return path == "-" || path == "/dev/stdout" || path == "/dev/stderr" || path.starts_with("/dev/fd/") ||
         path.starts_with("/proc/");
}

// ".<stem>.rbvh-tmp[.<attempt>]<extension>" in `folder`, the stem cut so that the name stays legal.
std::string temporary_name(const std::string& folder, const std::string& path, int attempt) {
  const std::filesystem::path name = std::filesystem::path(path).filename();
  std::string end = ".rbvh-tmp";
  if (attempt > 0) end.append(".").append(std::to_string(attempt));
  end += name.extension().string();
  std::string full = ".";
  full += name.stem().string();
  if (full.size() + end.size() > NAME_MAX)
    full.resize(NAME_MAX - std::min<std::size_t>(NAME_MAX - 1, end.size()));
  return (std::filesystem::path(folder) / (full + end)).string();
}

constexpr int kMostWriters = 1000;  // at once, of one output
constexpr int kTidied = 16;         // names that killed writers may have used

// A new file, never through an existing link, registered for removal and locked; `lock` is set. Every writer
// of an output tries the same names in turn, and removes what killed ones left there. (Where the file system
// knows no locks, files are never found to be abandoned.)
std::string create_temporary(const std::string& folder, const std::string& path, int& lock) {
  std::string own;
  for (int attempt = 0; own.empty() || attempt < kTidied; ++attempt) {
    std::string name = temporary_name(folder, path, attempt);
    if (name.size() >= PATH_MAX) fail_output(path, "cannot be created", ENAMETOOLONG);
    const HoldInterrupts hold;
    remove_abandoned(name);
    if (!own.empty()) continue;
    Descriptor file{::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666)};
    if (file.fd >= 0) {
      static_cast<void>(flock(file.fd, LOCK_EX));
      if (!is_same_file(file.fd, name)) continue;  // taken for abandoned before it was locked
      add_unfinished(name);
      lock = std::exchange(file.fd, -1);
      own = name;
      continue;
    }
    if (errno == EEXIST && attempt < kMostWriters) continue;
    const int error = errno;
    if (error == ENOTDIR) fail_output(path, "cannot be created, as part of its path is no folder", error);
    if (error == ENOENT) check_folder(path, folder);
    fail_output(path, "cannot be created", error);
  }
  return own;
}

void copy_to_special(const std::string& temporary, const std::string& path) {
  const Descriptor from{::open(temporary.c_str(), O_RDONLY | O_CLOEXEC)};
  if (from.fd < 0) fail_output(path, "cannot be written", errno);
  Descriptor own{path == "-" ? -1 : ::open(path.c_str(), O_WRONLY | O_CLOEXEC)};
  if (path != "-" && own.fd < 0) fail_output(path, "cannot be opened for writing", errno);
  const int to = path == "-" ? STDOUT_FILENO : own.fd;
  std::vector<char> block(1 << 16);
  for (;;) {
    const ssize_t n = ::read(from.fd, block.data(), block.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail_output(path, "cannot be written", errno);
    if (n == 0) break;
    if (const int error = write_fully(to, block.data(), static_cast<std::size_t>(n)))
      fail_output(path, "cannot be written", error);
  }
  if (own.fd >= 0 && own.close() != 0) fail_output(path, "cannot be written", errno);
}

[[noreturn]] void refuse_existing(const std::string& path) {
  throw Error(ErrorKind::kFailure, path, "exists already", Remedy::kOverwrite);
}

}  // namespace

OutputFile::OutputFile(const std::string& path, bool overwrite, Role role)
    : path_(path), target_(path), overwrite_(overwrite) {
  if (path.empty()) throw Error(ErrorKind::kFailure, "", "an output has an empty name; give it one");
  struct stat status {};
  const bool exists = path != "-" && ::stat(path.c_str(), &status) == 0;
  if (!exists && path != "-" && errno != ENOENT && errno != ENOTDIR)
    fail_output(path, "cannot be created", errno);
  if (exists && S_ISDIR(status.st_mode))
    throw Error(ErrorKind::kFailure, path, "is a folder; give a file's name");
  is_special_ = names_descriptor(path) || (exists && !S_ISREG(status.st_mode));
  if (is_special_) {
    if (path != "-" && access(path.c_str(), W_OK) != 0) fail_output(path, "cannot be written", errno);
    std::error_code ignored;
    const std::filesystem::path folder = std::filesystem::temp_directory_path(ignored);
    temporary_ = create_temporary(ignored ? "/tmp" : folder.string(), path == "-" ? "stdout" : path, lock_);
    lose_name();
    return;
  }
  if (exists && !overwrite) refuse_existing(path);
  if (role == Role::kAlone) target_ = follow_link(path);
  if (role == Role::kInSet) check_addressed_path(path);
  temporary_ = create_temporary(folder_of(target_), target_, lock_);
}

OutputFile::~OutputFile() {
  const HoldInterrupts hold;
  discard();
  ::close(lock_);
}

void OutputFile::lose_name() {
  const std::string by_number = "/proc/self/fd/" + std::to_string(lock_);
  if (access(by_number.c_str(), F_OK) != 0) return;  // where there is no /proc
  const HoldInterrupts hold;
  discard();
  temporary_ = by_number;
}

void OutputFile::write(std::span<const std::byte> bytes) {
  Descriptor file{::open(temporary_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC)};
  if (file.fd < 0) fail_output(path_, "cannot be written", errno);
  if (const int error = write_fully(file.fd, reinterpret_cast<const char*>(bytes.data()), bytes.size()))
    fail_output(path_, "cannot be written", error);
  if (file.close() != 0) fail_output(path_, "cannot be written", errno);
}

void OutputFile::write(std::string_view text) { write(std::as_bytes(std::span(text))); }

void OutputFile::commit() {
  if (is_special_) return copy_to_special(temporary_, path_);
  RBVH_CHECK(!is_kept_);
  sync();
  int error = 0;
  {
    const HoldInterrupts hold;
    move_into_place();
    error = sync_path(folder_of(target_));
  }
  if (error != 0) warn_of_output(unsynced_folder(path_, error));
}

void OutputFile::sync() const {
  if (const int error = sync_path(temporary_)) fail_output(path_, "cannot be synced to disk", error);
}

void OutputFile::move_aside(const std::string& name) {
  struct stat status {};
  const bool is_new = lstat(name.c_str(), &status) != 0;
  if (const int error = rename_file(temporary_, name, true))
    fail_output(path_, "cannot be moved into place", error);
  drop_unfinished(temporary_);
  temporary_ = name;
  is_kept_ = !is_new;  // the old set may need it
}

void OutputFile::move_into_place() {
  const int error = rename_into_place();
  if (error == EEXIST) refuse_existing(path_);
  if (error != 0) fail_output(path_, "cannot be moved into place", error);
  keep();
}

int OutputFile::rename_into_place() {
  // Best effort: the new file gets the old one's mode.
  struct stat old {};
  if (overwrite_ && ::stat(target_.c_str(), &old) == 0)
    static_cast<void>(!chmod(temporary_.c_str(), old.st_mode & 07777));
  return rename_file(temporary_, target_, overwrite_);
}

void OutputFile::keep() {
  is_kept_ = true;
  drop_unfinished(temporary_);
}

void OutputFile::discard() {
  if (!is_kept_) unlink(temporary_.c_str());
  keep();
}

void fail_output(const std::string& path, const std::string& what, int error) {
  stop_where_exiting();  // the handler may have taken the file away
  throw Error(ErrorKind::kFailure, shown(path), what + ": " + std::strerror(error));
}

void set_output_warning(std::function<void(std::string_view)> sink) {
  const std::lock_guard lock(g_warning_mutex);
  g_warning = std::move(sink);
}

void warn_of_output(const std::string& line) {
  const std::lock_guard lock(g_warning_mutex);
  if (g_warning) g_warning(line);
}

std::string unsynced_folder(const std::string& path, int error) {
  return path + " is written, but its folder cannot be synced to disk: " + std::strerror(error);
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
