// Every output goes through here: written under a temporary name in the same folder, synced, renamed. Nothing is
// overwritten unasked, nothing is left half-written, and an interrupt removes what is unfinished.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace rbvh {

/// One output on its way. Where `path` is no regular file (a device, a pipe), temporary_path() is still a regular
/// file, and commit() copies its bytes there. "-" is standard output.
class OutputFile {
 public:
  /// Throws Error(kFailure) when `path` exists and !overwrite, or its folder is missing or cannot be written to. The
  /// temporary name keeps the extension of `path`, for libraries that choose a format by it.
  OutputFile(const std::string& path, bool overwrite);
  ~OutputFile();  ///< removes the temporary file if it was not committed
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& path() const { return path_; }
  const std::string& temporary_path() const { return temporary_; }
  /// Writes the whole content of the temporary file. Throws Error(kFailure).
  void write(std::span<const std::byte> bytes);
  void write(std::string_view text);
  /// fsync and rename. Throws Error(kFailure).
  void commit();

 private:
  std::string path_, temporary_;
  bool committed_ = false, overwrite_ = false, is_special_ = false;
};

/// SIGINT, SIGTERM and SIGHUP remove every uncommitted temporary file and exit with 130. Called once by main.
void install_interrupt_cleanup();

/// Throws the same Error as OutputFile's constructor would, before any work is done.
void check_output(const std::string& path, bool overwrite);

}  // namespace rbvh
