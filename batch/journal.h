// What a batch has done to one scan, so that it need not do it again: for each step, what it depended on and
// what it wrote. A file of its own for each scan, in the folder .rbvh-batch of the output folder.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace rbvh {

/// A file as it was found. Its content is read again only where size or time have changed.
struct FileStamp {
  std::string path;
  std::uint64_t bytes = 0;
  std::int64_t modified = 0;  ///< ns since 1970
  std::uint64_t hash = 0;
};

/// Stamps a file, by `before` where that is still true. Nothing where there is no such regular file. Throws
/// Error(kInput) where it cannot be read.
std::optional<FileStamp> stamp(const std::string& path, const FileStamp* before = nullptr);

struct StepRecord {
  std::string step;
  std::uint64_t key = 0;  ///< hash of version, words, and the content of all files that were read
  std::vector<FileStamp> outputs;
  double seconds = 0;
  std::uint64_t peak_bytes = 0;  ///< of the process
  std::uint64_t warnings = 0;
  nlohmann::ordered_json levels;  ///< of a build: names and errors; else null
};

struct Journal {
  FileStamp source;
  std::vector<StepRecord> steps;
};

/// An empty journal where the file is missing or no journal: everything is done again then.
Journal read_journal(const std::string& path);

/// Replaces the file as a whole. Throws Error(kFailure).
void write_journal(const std::string& path, const Journal& journal);

}  // namespace rbvh
