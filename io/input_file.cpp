#include "io/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

struct Descriptor {
  int fd;
  bool owned;
  ~Descriptor() {
    if (owned) ::close(fd);
  }
};

}  // namespace

std::string input_name(const std::string& path) { return path == "-" ? "standard input" : path; }

InputBytes read_input(const std::string& path) {
  const std::string name = input_name(path);
  const bool is_stdin = path == "-";
  const Descriptor in{is_stdin ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC), !is_stdin};
  if (in.fd < 0)
    throw Error(ErrorKind::kInput, name, std::string("cannot be opened: ") + std::strerror(errno));
  struct stat status {};
  if (::fstat(in.fd, &status) != 0)
    throw Error(ErrorKind::kInput, name, std::string("cannot be read: ") + std::strerror(errno));
  if (S_ISDIR(status.st_mode)) throw Error(ErrorKind::kInput, name, "is a folder; name a file in it");

  InputBytes bytes;
  // One byte more than the file has, so that its end is seen without growing the buffer.
  std::size_t capacity =
      S_ISREG(status.st_mode) ? static_cast<std::size_t>(status.st_size) + 1 : std::size_t{1} << 20;
  try {
    bytes.data.reset(new char[capacity]);
    for (;;) {
      if (bytes.size == capacity) {
        std::unique_ptr<char[]> larger(new char[capacity * 2]);
        std::memcpy(larger.get(), bytes.data.get(), bytes.size);
        bytes.data = std::move(larger);
        capacity *= 2;
      }
      const std::size_t piece = std::min(capacity - bytes.size, std::size_t{1} << 30);
      const ssize_t got = ::read(in.fd, bytes.data.get() + bytes.size, piece);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0)
        throw Error(ErrorKind::kInput, name,
                    "cannot be read at byte " + std::to_string(bytes.size) + ": " + std::strerror(errno));
      if (got == 0) break;
      bytes.size += static_cast<std::size_t>(got);
    }
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::kBudget, name, "does not fit in memory (" + std::to_string(capacity) + " bytes)");
  }
  if (bytes.size == 0) throw Error(ErrorKind::kInput, name, "is empty");
  return bytes;
}

}  // namespace rbvh
