#include "pipeline/device/prepare_pocl.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <utility>

#include "pipeline/base/parallel_for.h"

namespace rbvh::device_detail {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kLeastRoom = 4 << 20;  // the largest file that a compile writes takes 1 MB
constexpr auto kLongestCompile = std::chrono::hours(1);

struct Cache {
  fs::path folder;
  bool is_ours = false;  // not PoCL's own choice
};
Cache g_cache;

/// As PoCL has it.
fs::path wanted_cache() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value != nullptr ? value : "");
  };
  if (const std::string cache = variable("POCL_CACHE_DIR"); !cache.empty()) return cache;
  if (const std::string cache = variable("XDG_CACHE_HOME"); !cache.empty())
    return fs::path(cache) / "pocl/kcache";
  if (const std::string home = variable("HOME"); !home.empty()) return fs::path(home) / ".cache/pocl/kcache";
  return "/tmp/pocl/kcache";
}

bool can_hold_kernels(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  std::string name = (folder / "rbvh-XXXXXX").string();
  const int file = mkostemp(name.data(), O_CLOEXEC);
  if (file < 0) return false;
  unlink(name.c_str());
  const std::array<char, 4096> page{};
  struct statvfs status {};
  const bool is_written = ::write(file, page.data(), page.size()) == ssize_t{page.size()};
  const bool has_room = fstatvfs(file, &status) == 0 && status.f_bavail * status.f_frsize >= kLeastRoom;
  ::close(file);
  return is_written && has_room;
}

/// What is compiled is run: nobody else may write there.
bool is_private(const fs::path& folder) {
  struct stat status {};
  return lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) && status.st_uid == geteuid() &&
         (status.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

Cache choose_cache() {
  const fs::path wanted = wanted_cache();
  if (can_hold_kernels(wanted)) return {wanted, false};
  std::error_code error;
  for (const fs::path& parent : {fs::temp_directory_path(error), fs::path("/tmp"), fs::path("/dev/shm")}) {
    if (parent.empty()) continue;
    const fs::path folder = parent / ("rbvh-kernels-" + std::to_string(geteuid()));
    mkdir(folder.c_str(), 0700);
    if (is_private(folder) && can_hold_kernels(folder)) return {folder, true};
  }
  return {wanted, false};  // PoCL fails then
}

}  // namespace

void prepare_pocl() {
  static std::once_flag once;
  std::call_once(once, [] {
    const std::string threads = std::to_string(thread_count());
    setenv("POCL_MAX_PTHREAD_COUNT", threads.c_str(), 0);  // up to PoCL 4
    setenv("POCL_CPU_MAX_CU_COUNT", threads.c_str(), 0);
    g_cache = choose_cache();
    if (g_cache.is_ours) setenv("POCL_CACHE_DIR", g_cache.folder.c_str(), 1);
  });
}

std::string pocl_cache_in_words() {
  if (!g_cache.is_ours) return "they are kept in its cache";
  return "they are kept in " + g_cache.folder.string() + ", as its cache cannot be written";
}

void tidy_pocl_cache() {
  std::error_code error;
  const fs::directory_iterator end;
  for (fs::directory_iterator entry(g_cache.folder, error); !error && entry != end; entry.increment(error)) {
    const fs::path name = entry->path().filename();
    std::error_code gone;
    if (!name.string().starts_with("tempfile_") || !entry->is_regular_file(gone)) continue;
    const bool is_of_a_start = !name.has_extension() && entry->file_size(gone) == 0;
    const auto age = fs::file_time_type::clock::now() - entry->last_write_time(gone);
    if (!gone && (is_of_a_start || age > kLongestCompile)) fs::remove(entry->path(), gone);
  }
}

std::string pocl_obstacle() {
  rlimit limit{};
  if (getrlimit(RLIMIT_FSIZE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= kLeastRoom)
    return {};
  return "files may have " + std::to_string(limit.rlim_cur) + " bytes at most, and compiling kernels takes " +
         std::to_string(kLeastRoom) + "; raise the limit (ulimit -f)";
}

}  // namespace rbvh::device_detail
