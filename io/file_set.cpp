#include "io/file_set.h"

#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <utility>

#include "io/hash.h"
#include "io/interrupts.h"
#include "io/posix_file.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kHashDigits = 16;
constexpr std::chrono::seconds kLongestWait{10};  // for another writer, which renames and syncs a few times

// One writer of a set at a time: a lock on an empty file beside the head. The file goes with its writer; one
// that a killed writer left serves the next. Where there are no locks, we go on without.
class SetLock {
 public:
  explicit SetLock(const std::string& head)
      : path_((fs::path(folder_of(head)) / ("." + fs::path(head).filename().string() + ".lock")).string()) {
    const auto deadline = std::chrono::steady_clock::now() + kLongestWait;
    while (!try_lock()) {
      if (std::chrono::steady_clock::now() > deadline)
        throw Error(ErrorKind::kFailure, head,
                    "is being replaced by another process, which does not finish; end it, or try again");
      poll(nullptr, 0, 2);
    }
  }
  ~SetLock() {
    if (fd_ < 0) return;
    const HoldInterrupts hold;
    drop_unfinished(path_);
    unlink(path_.c_str());
    ::close(fd_);
  }
  SetLock(const SetLock&) = delete;
  SetLock& operator=(const SetLock&) = delete;

 private:
  bool try_lock() {
    const HoldInterrupts hold;
    Descriptor file{::open(path_.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW)};
    if (file.fd < 0 && errno == ENOENT) {
      file.fd = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666);
      if (file.fd >= 0) static_cast<void>(fchmod(file.fd, 0666));  // for other users, whatever our umask
    }
    if (file.fd < 0) return errno != EEXIST;
    const bool is_busy = flock(file.fd, LOCK_EX | LOCK_NB) != 0 && (errno == EWOULDBLOCK || errno == EINTR);
    if (is_busy || !is_same_file(file.fd, path_)) return false;  // not the same: its writer has just finished
    add_unfinished(path_);
    fd_ = std::exchange(file.fd, -1);
    return true;
  }

  std::string path_;
  int fd_ = -1;
};

bool has_hash(const std::string& path, std::uint64_t hash) {
  try {
    return hash_bytes(read_input(path).view()) == hash;
  } catch (const Error&) {
    return false;
  }
}

// Of writers that were killed: parts that never came to their place.
void remove_leftovers(const OutputFile& head, std::span<const SetPart> parts) {
  std::error_code error;
  const fs::directory_iterator end;
  for (fs::directory_iterator entry(folder_of(head.path()), error); !error && entry != end;
       entry.increment(error)) {
    const std::string path = entry->path().string();
    const auto aside = parse_addressed(entry->path().filename().string());
    for (const SetPart& part : parts)
      if (aside && aside->path == fs::path(part.file->path()).filename() && aside->hash != part.hash)
        remove_abandoned(path, [&] { return has_hash(path, aside->hash); });  // not a user's own file
  }
}

}  // namespace

std::string addressed_path(const std::string& path, std::uint64_t hash) {
  const std::string extension = fs::path(path).extension().string();
  return fs::path(path).replace_extension("." + hash_digits(hash) + extension).string();
}

std::optional<Addressed> parse_addressed(const std::string& path) {
  const fs::path file = path, stem = file.stem();
  const std::string digits = stem.extension().string();  // with a dot
  if (digits.size() != 1 + kHashDigits) return {};
  Addressed address{(file.parent_path() / stem.stem()).string() + file.extension().string(), 0};
  std::from_chars(digits.data() + 1, digits.data() + digits.size(), address.hash, 16);
  if (addressed_path(address.path, address.hash) != path) return {};
  return address;
}

void check_addressed_path(const std::string& path) {
  const std::string longest = addressed_path(path, 0);
  if (longest.size() >= PATH_MAX || fs::path(longest).filename().string().size() > NAME_MAX)
    fail_output(path, "cannot be created", ENAMETOOLONG);
}

void commit_set(OutputFile& head, std::span<const SetPart> parts) {
  head.sync();
  for (const SetPart& part : parts) part.file->sync();
  const std::string folder = folder_of(head.path());
  const SetLock lock(head.path());
  std::string warning;
  const auto warn = [&](const std::string& line) { warning += (warning.empty() ? "" : "; ") + line; };
  {
    const HoldInterrupts hold;
    try {
      for (const SetPart& part : parts) part.file->move_aside(addressed_path(part.file->path(), part.hash));
      if (const int error = sync_path(folder)) fail_output(head.path(), "cannot be synced to disk", error);
      head.move_into_place();
    } catch (...) {
      for (const SetPart& part : parts) part.file->discard();  // as long as no other writer has that name
      throw;
    }

    // The new set is there, and nothing is an error any more.
    for (const SetPart& part : parts) part.file->keep();
    if (const int error = sync_path(folder)) {
      // The old head may be back after a crash, so its parts stay where they are.
      warn(unsynced_folder(head.path(), error));
      for (const SetPart& part : parts) warn(part.file->path() + " lies in " + part.file->temporary_path());
      return warn_of_output(warning);
    }
    // Where a writer without our lock has replaced the head, its parts stay, too.
    if (!is_same_file(head.lock_, head.path())) return;
    for (const SetPart& part : parts)
      if (const int error = part.file->rename_into_place())
        warn(part.file->path() + " cannot be replaced (" + std::strerror(error) + "); the new one is " +
             part.file->temporary_path() + " and is read instead");
    if (const int error = sync_path(folder)) warn(unsynced_folder(head.path(), error));
  }
  remove_leftovers(head, parts);
  if (!warning.empty()) warn_of_output(warning);
}

std::optional<FoundPart> find_part(std::span<const std::string> paths, std::uint64_t bytes,
                                   std::uint64_t hash) {
  std::vector<std::string> places(paths.begin(), paths.end());
  places.push_back(addressed_path(places.back(), hash));
  places.erase(std::unique(places.begin(), places.end()), places.end());
  for (const std::string& place : places) {
    std::error_code error;
    if (fs::file_size(place, error) != bytes || error) continue;
    try {
      FoundPart part{place, read_input(place)};
      if (part.bytes.size == bytes && hash_bytes(part.bytes.view()) == hash) return part;
    } catch (const Error& failure) {
      // From the last it may have gone to its place just now.
      if (failure.kind() != ErrorKind::kInput || place != places.back()) throw;
    }
  }
  return {};
}

std::vector<std::int64_t> file_states(std::span<const std::string> paths) {
  std::vector<std::int64_t> states;
  for (const std::string& path : paths) {
    struct stat status {};
    ::stat(path.c_str(), &status);  // all zero where it is not there
    states.insert(states.end(),
                  {static_cast<std::int64_t>(status.st_dev), static_cast<std::int64_t>(status.st_ino),
                   status.st_size, status.st_ctim.tv_sec, status.st_ctim.tv_nsec});
  }
  return states;
}

}  // namespace rbvh
