#include "io/input_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <vector>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

/// Standard input for "-".
int open_input(const std::string& path, const std::string& name, struct stat& status) {
  const int fd = path == "-" ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) throw Error(ErrorKind::kInput, name, std::string("cannot be opened: ") + std::strerror(errno));
  const bool is_known = ::fstat(fd, &status) == 0;
  if (is_known && !S_ISDIR(status.st_mode)) return fd;
  const int why = errno;
  if (fd != STDIN_FILENO) ::close(fd);
  if (is_known) throw Error(ErrorKind::kInput, name, "is a folder; name a file in it");
  throw Error(ErrorKind::kInput, name, std::string("cannot be read: ") + std::strerror(why));
}

}  // namespace

std::string input_name(const std::string& path) { return path == "-" ? "standard input" : path; }

InputStream::InputStream(const std::string& path) : name_(input_name(path)) {
  struct stat status {};
  fd_ = open_input(path, name_, status);
  if (S_ISREG(status.st_mode) && path != "-") file_bytes_ = static_cast<std::uint64_t>(status.st_size);
  if (!S_ISREG(status.st_mode)) stop_fd_ = eventfd(0, EFD_CLOEXEC);
}

InputStream::~InputStream() {
  if (stop_fd_ >= 0) ::close(stop_fd_);
  if (fd_ != STDIN_FILENO) ::close(fd_);
}

std::size_t InputStream::read(std::span<std::byte> to) {
  constexpr std::size_t kMost = std::size_t{1} << 30;
  std::size_t size = 0;
  while (size < to.size()) {
    if (stop_fd_ >= 0) {
      pollfd ends[] = {{fd_, POLLIN, 0}, {stop_fd_, POLLIN, 0}};
      poll(ends, 2, -1);
      if (ends[1].revents != 0) break;
    }
    const ssize_t got = ::read(fd_, to.data() + size, std::min(to.size() - size, kMost));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0)
      throw Error(ErrorKind::kInput, name_,
                  "cannot be read at byte " + std::to_string(at_) + ": " + std::strerror(errno));
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
    at_ += static_cast<std::size_t>(got);
  }
  return size;
}

void InputStream::stop() {
  const std::uint64_t one = 1;
  if (stop_fd_ >= 0) static_cast<void>(!::write(stop_fd_, &one, sizeof one));
}

std::uint64_t InputStream::skip() {
  std::vector<std::byte> piece(1 << 16);
  const std::uint64_t from = at_;
  while (read(piece) > 0) {
  }
  return at_ - from;
}

InputBytes read_input(const std::string& path) {
  InputStream in(path);
  const std::string& name = in.name();
  InputBytes bytes;
  // One byte more than the file has, so that its end is seen without growing the buffer.
  std::size_t capacity =
      in.file_bytes() ? static_cast<std::size_t>(*in.file_bytes()) + 1 : std::size_t{1} << 20;
  try {
    bytes.data.reset(new char[capacity]);
    for (;;) {
      const std::span rest(bytes.data.get() + bytes.size, capacity - bytes.size);
      const std::size_t got = in.read(std::as_writable_bytes(rest));
      bytes.size += got;
      if (got < rest.size()) break;
      std::unique_ptr<char[]> larger(new char[capacity * 2]);
      std::memcpy(larger.get(), bytes.data.get(), bytes.size);
      bytes.data = std::move(larger);
      capacity *= 2;
    }
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::kBudget, name, "does not fit in memory (" + std::to_string(capacity) + " bytes)");
  }
  if (bytes.size == 0) throw Error(ErrorKind::kInput, name, "is empty");
  return bytes;
}

}  // namespace rbvh
