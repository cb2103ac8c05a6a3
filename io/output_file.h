// Every output goes through here: written under a temporary name in the same folder, synced, renamed. Nothing
// is overwritten unasked, nothing is left half-written, and an interrupt removes what is unfinished. Files
// that belong together are committed by io/file_set.h.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace rbvh {

struct SetPart;

/// One output on its way. Where `path` is no regular file (a device, a pipe), temporary_path() is still a
/// regular file, which has no other name, and commit() copies its bytes there. "-" is standard output.
class OutputFile {
 public:
  enum class Role {
    kAlone,
    kInSet  ///< of files that lie together: a link is replaced, not followed; the name needs room for a hash
  };

  /// Throws Error(kFailure) when `path` exists and !overwrite, is a folder, or its folder is missing or
  /// cannot be written to. The temporary name keeps the extension of `path`, for libraries that choose a
  /// format by it. A link is followed: what it points to is replaced.
  OutputFile(const std::string& path, bool overwrite, Role role = Role::kAlone);
  ~OutputFile();  ///< removes the temporary file if it was not committed
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& path() const { return path_; }
  const std::string& temporary_path() const { return temporary_; }
  /// Appends to the temporary file. Throws Error(kFailure).
  void write(std::span<const std::byte> bytes);
  void write(std::string_view text);
  /// fsync and rename. Throws Error(kFailure); warns where the output is there and its folder cannot be
  /// synced.
  void commit();
  bool is_special() const { return is_special_; }

 private:
  friend void commit_set(OutputFile& head, std::span<const SetPart> parts);
  void lose_name();   // the temporary file's
  void sync() const;  // the temporary file's bytes
  // The rest with interrupts held.
  void move_aside(const std::string& name);  // the temporary file, over what is there
  void move_into_place();
  int rename_into_place();  // errno
  void keep();              // the temporary file, whatever it is named now
  void discard();           // it, unless it is kept

  std::string path_, target_, temporary_;  ///< target_: path_, or where it leads as a link
  int lock_ = -1;  ///< on the temporary file: while it is held, the file is not abandoned
  bool is_kept_ = false, overwrite_ = false, is_special_ = false;
};

/// What set_output_warning() of rbvh/io.h gets.
void warn_of_output(const std::string& line);

/// For an output that is there, and may be gone after a cut of the power.
std::string unsynced_folder(const std::string& path, int error);

/// Throws Error(kFailure): "path: what: errno's words".
[[noreturn]] void fail_output(const std::string& path, const std::string& what, int error);

/// Throws Error(kFailure) where `folder`, in which `path` is to be, does not exist.
void check_folder(const std::string& path, const std::string& folder);

/// Throws Error(kUsage) for an output that is an input or named twice, and for two inputs "-". Empty names
/// are none; a device may be named twice.
void check_paths_differ(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

/// Throws the same Error as OutputFile's constructor would, before any work is done.
void check_output(const std::string& path, bool overwrite);

}  // namespace rbvh
