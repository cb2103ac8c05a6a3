// Files that belong together and replace older ones together: a pair, a proxy. One of them, the head, names
// the others, its parts, by length and hash. Replacing the head is what replaces the set, at once:
//
//   1. each part gets the name NAME.HASH.EXT beside its place     a reader finds the old set
//   2. the head is renamed over the old one                       a reader finds the new set, by HASH
//   3. each part is renamed to its place, NAME.EXT
//
// The folder is synced after each step. Where the third fails, a part stays where it is and is found there.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/input_file.h"
#include "io/output_file.h"

namespace rbvh {

struct SetPart {
  OutputFile* file;
  std::uint64_t hash;  ///< hash_bytes() of its bytes
};

/// NAME.HASH.EXT, where a part of this hash may lie as well as at NAME.EXT.
std::string addressed_path(const std::string& path, std::uint64_t hash);

/// What addressed_path() made a path of, or nothing.
struct Addressed {
  std::string path;
  std::uint64_t hash;
};
std::optional<Addressed> parse_addressed(const std::string& path);

/// Throws Error(kFailure) where the file system has no room for that name.
void check_addressed_path(const std::string& path);

/// Commits a set to one folder, as above. Head and parts are OutputFiles kInSet. One writer at a time does
/// this; others wait. Then parts that killed writers of the set left are removed. Warns
/// (warn_of_output()) of what goes wrong after step 2, when the new set is there and whole. Throws
/// Error(kFailure) where the old set is left as it was.
void commit_set(OutputFile& head, std::span<const SetPart> parts);

/// A part as it was found.
struct FoundPart {
  std::string path;
  InputBytes bytes;
};

/// The first file with this length and hash among `paths` and the addressed_path() of the last. Nothing, too,
/// where a writer has replaced it meanwhile.
std::optional<FoundPart> find_part(std::span<const std::string> paths, std::uint64_t bytes,
                                   std::uint64_t hash);

/// Which files these names lead to. While a writer replaces them, this changes; a reader that found no whole
/// set reads again if it did, up to kMostReads times.
std::vector<std::int64_t> file_states(std::span<const std::string> paths);
inline constexpr int kMostReads = 20;

}  // namespace rbvh
