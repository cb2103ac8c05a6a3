// A whole input in memory: readers parse from here, so that every count can be checked against the bytes that
// are there. And a stream of what is too long for that.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace rbvh {

/// The bytes of a file, read once. Not mapped: a mapped file that another program truncates raises SIGBUS.
struct InputBytes {
  std::unique_ptr<char[]> data;
  std::size_t size = 0;
  std::string_view view() const { return {data.get(), size}; }
};

/// Reads `path` ("-": standard input) to its end. Throws Error(kInput) when it is missing, a folder, or
/// unreadable, Error(kBudget) when memory does not hold it.
InputBytes read_input(const std::string& path);

/// The same bytes, read piece by piece.
class InputStream {
 public:
  explicit InputStream(const std::string& path);
  ~InputStream();
  InputStream(const InputStream&) = delete;
  InputStream& operator=(const InputStream&) = delete;

  const std::string& name() const { return name_; }
  /// Of a regular file that is named.
  std::optional<std::uint64_t> file_bytes() const { return file_bytes_; }
  /// Fills `to`, or less at the end; how much.
  std::size_t read(std::span<std::byte> to);
  std::uint64_t skip();  ///< all that follow; how many
  /// Ends what is to be read here and now, also where another thread is waiting in read() for who writes into
  /// a pipe.
  void stop();

 private:
  std::string name_;
  int fd_ = -1, stop_fd_ = -1;  ///< stop_fd_: readable once stop() was called; none for a regular file
  std::uint64_t at_ = 0;
  std::optional<std::uint64_t> file_bytes_;
};

/// How an input is named in messages: its path, or "standard input".
std::string input_name(const std::string& path);

}  // namespace rbvh
