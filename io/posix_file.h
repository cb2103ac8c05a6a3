// The few steps on files that outputs are made of. Errors are numbers (errno; 0: none): who calls knows what
// to say.
#pragma once

#include <functional>
#include <string>

namespace rbvh {

/// Closes on every way out; close() is where some file systems report a full disk.
struct Descriptor {
  int fd;
  ~Descriptor();
  int close();  ///< as ::close()
};

std::string folder_of(const std::string& path);

/// Where a link that leads to a file leads, else `path` itself.
std::string follow_link(const std::string& path);

/// Whether `path` still names the regular file that is open as `fd`.
bool is_same_file(int fd, const std::string& path);

/// Removes a regular file whose writer has died: a living one holds a lock on it (flock). `is_ours` is asked
/// first.
void remove_abandoned(const std::string& path, const std::function<bool()>& is_ours = {});

/// fsync of a file or folder. One that cannot be synced by its nature is no error.
int sync_path(const std::string& path);

/// Without `replace`, a file that is there already is EEXIST.
int rename_file(const std::string& from, const std::string& to, bool replace);

}  // namespace rbvh
