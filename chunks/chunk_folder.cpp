#include "chunks/chunk_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <vector>

#include "chunks/chunk_journal.h"
#include "io/hash.h"
#include "io/output_file.h"
#include "io/posix_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/text.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLock = "lock";
constexpr std::size_t kKeyDigits = 16;

/// "NAME.parts-", which the key follows.
std::string prefix_of(const std::string& target) { return fs::path(target).stem().string() + ".parts-"; }

/// Nothing where another run holds it, or it cannot be made.
std::shared_ptr<int> lock_folder(const std::string& path, bool create) {
  const std::string lock = (fs::path(path) / kLock).string();
  const int fd = ::open(lock.c_str(), O_RDWR | O_CLOEXEC | (create ? O_CREAT : 0), 0666);
  if (fd < 0) return nullptr;
  std::shared_ptr<int> held(new int(fd), [](const int* file) {
    ::close(*file);
    delete file;
  });
  if (flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return nullptr;
  return held;
}

bool is_part_file(const std::string& name) {
  return name.size() > 4 && name.find_first_not_of("0123456789") == 4 &&
         (name.ends_with(".rbvh") || name.ends_with(".atlas.tif"));
}

void remove_files(const ChunkFolder& folder, const std::function<bool(const std::string& name)>& which) {
  std::error_code ignored;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.path, ignored))
    if (which(entry.path().filename().string())) files.push_back(entry.path());
  for (const fs::path& file : files) fs::remove(file, ignored);
}

}  // namespace

std::string part_name(std::size_t number) {
  char name[32];
  std::snprintf(name, sizeof name, "%04zu.rbvh", number);
  return name;
}

ChunkFolder open_chunk_folder(const std::string& output, std::uint64_t key) {
  const std::string target = follow_link(output);
  ChunkFolder folder;
  folder.name = prefix_of(target) + hash_digits(key);
  folder.path = (fs::path(folder_of(target)) / folder.name).string();
  std::error_code code;
  fs::create_directory(folder.path, code);
  if (code) fail_output(folder.path, "cannot be created", code.value());
  folder.lock = lock_folder(folder.path, true);
  if (folder.lock == nullptr) {
    const int error = errno;
    if (error != EWOULDBLOCK) fail_output(folder.path, "cannot be written to", error);
    throw Error(ErrorKind::kFailure, output, "is being built by another run; wait for its end");
  }
  return folder;
}

void empty_folder(const ChunkFolder& folder) {
  remove_files(folder, [](const std::string& name) { return !is_part_file(name) && name != kLock; });
}

void discard_folder(ChunkFolder& folder) {
  remove_files(folder, [](const std::string& name) { return !is_part_file(name); });
  std::error_code ignored;
  fs::remove(folder.path, ignored);  // where it is empty
  folder.lock.reset();
}

void check_room(const ChunkFolder& folder, std::uint64_t bytes, const std::string& file) {
  std::error_code code;
  const fs::space_info space = fs::space(folder.path, code);
  if (!code && space.available < bytes)
    throw Error(ErrorKind::kFailure, file,
                "building it in chunks takes about " + format_bytes(bytes) + " of disk, and " +
                    format_bytes(space.available) + " are free beside the output; free some");
}

void finish_folder(ChunkFolder& folder, const std::string& output) {
  std::error_code ignored;
  remove_files(folder, [](const std::string& name) { return !is_part_file(name) && name != kJournalName; });
  const std::string prefix = prefix_of(follow_link(output));
  std::vector<fs::path> others;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_of(follow_link(output)), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.size() == prefix.size() + kKeyDigits && name.starts_with(prefix) && name != folder.name &&
        name.find_first_not_of("0123456789abcdef", prefix.size()) == std::string::npos)
      others.push_back(entry.path());
  }
  for (const fs::path& other : others)
    if (!fs::exists(other / kLock, ignored) || lock_folder(other.string(), false) != nullptr)
      fs::remove_all(other, ignored);
  folder.lock.reset();
}

}  // namespace rbvh
