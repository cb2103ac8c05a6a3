// A file without a name for what leaves memory and comes back: it is gone with the process, however that
// ends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace rbvh {

class SpillFile {
 public:
  SpillFile() = default;
  SpillFile(const SpillFile&) = delete;
  SpillFile& operator=(const SpillFile&) = delete;
  ~SpillFile();

  /// Appends the bytes and returns where they begin; none where the folder of temporary files ($TMPDIR, else
  /// /tmp) is full or cannot hold such a file.
  std::optional<std::uint64_t> append(std::span<const std::byte> bytes);
  /// Fills `bytes` from `offset` on; false where they cannot be read.
  bool read(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  int fd_ = -1;
  std::uint64_t end_ = 0;
};

}  // namespace rbvh
