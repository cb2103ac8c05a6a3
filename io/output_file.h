// Every output goes through here: written under a temporary name in the same folder, synced, renamed. Nothing
// is overwritten unasked, nothing is left half-written, and an interrupt removes what is unfinished.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace rbvh {

/// One output on its way. Where `path` is no regular file (a device, a pipe), temporary_path() is still a
/// regular file, and commit() copies its bytes there. "-" is standard output.
class OutputFile {
 public:
  /// Throws Error(kFailure) when `path` exists and !overwrite, is a folder, or its folder is missing or
  /// cannot be written to. The temporary name keeps the extension of `path`, for libraries that choose a
  /// format by it. A link is followed: what it points to is replaced.
  OutputFile(const std::string& path, bool overwrite);
  ~OutputFile();  ///< removes the temporary file if it was not committed
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& path() const { return path_; }
  const std::string& temporary_path() const { return temporary_; }
  /// Appends to the temporary file. Throws Error(kFailure).
  void write(std::span<const std::byte> bytes);
  void write(std::string_view text);
  /// fsync and rename. Throws Error(kFailure).
  void commit();
  bool is_special() const { return is_special_; }
  bool is_committed() const { return committed_; }

 private:
  friend void commit_all(std::span<OutputFile* const> files);
  std::string path_, target_, temporary_;  ///< target_: path_ with its links followed
  bool committed_ = false, overwrite_ = false, is_special_ = false;
};

/// Syncs all of them, then renames them in the given order with interrupts held back. Throws Error(kFailure);
/// what was renamed before the failure stays.
void commit_all(std::span<OutputFile* const> files);

/// SIGINT, SIGTERM and SIGHUP remove every uncommitted temporary file and exit with 130. A broken pipe and a
/// file size limit become write errors instead of signals. Called once by main.
void install_interrupt_cleanup();

/// Throws Error(kFailure) where `folder`, in which `path` is to be, does not exist.
void check_folder(const std::string& path, const std::string& folder);

/// Throws Error(kUsage) for an output that is an input or named twice, and for two inputs "-". Empty names
/// are none; a device may be named twice.
void check_paths_differ(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

/// Throws the same Error as OutputFile's constructor would, before any work is done.
void check_output(const std::string& path, bool overwrite);

}  // namespace rbvh
