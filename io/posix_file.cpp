#include "io/posix_file.h"

#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>

namespace rbvh {

Descriptor::~Descriptor() {
  if (fd >= 0) ::close(fd);
}

int Descriptor::close() {
  const int result = ::close(fd);
  fd = -1;
  return result;
}

std::string folder_of(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

std::string follow_link(const std::string& path) {
  struct stat status {};
  std::array<char, PATH_MAX> real;
  if (lstat(path.c_str(), &status) != 0 || !S_ISLNK(status.st_mode)) return path;
  return realpath(path.c_str(), real.data()) == nullptr ? path : real.data();
}

bool is_same_file(int fd, const std::string& path) {
  struct stat open {
  }, named{};
  return fstat(fd, &open) == 0 && lstat(path.c_str(), &named) == 0 && S_ISREG(named.st_mode) &&
         open.st_dev == named.st_dev && open.st_ino == named.st_ino;
}

void remove_abandoned(const std::string& path, const std::function<bool()>& is_ours) {
  const Descriptor file{::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)};
  if (file.fd < 0 || flock(file.fd, LOCK_EX | LOCK_NB) != 0 || !is_same_file(file.fd, path)) return;
  if (!is_ours || is_ours()) unlink(path.c_str());
}

// EINVAL: a file system that cannot sync this kind of file, which is no reason to lose the output. EACCES: a
// folder that we may write to but not read.
int sync_path(const std::string& path) {
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.fd < 0) return errno == EACCES ? 0 : errno;
  return fsync(file.fd) == 0 || errno == EINVAL ? 0 : errno;
}

int rename_file(const std::string& from, const std::string& to, bool replace) {
  if (!replace) {
    if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS) return errno;
    if (access(to.c_str(), F_OK) == 0) return EEXIST;  // a file system without that flag
  }
  return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace rbvh
