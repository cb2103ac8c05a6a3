// The file pair NAME.rbvh + NAME.atlas.tif (docs/file_format.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "pipeline/rbvh/rbvh.h"

namespace rbvh {

/// Version of the format that write_rbvh() writes. read_rbvh() reads every minor version of this major one
/// and of 1.
inline constexpr std::uint16_t kFormatMajor = 2, kFormatMinor = 0;

/// The atlas that belongs to an .rbvh path: beside it, by stem. While a writer replaces the pair, and where
/// it was not able to replace the atlas, that lies beside this name (io/file_set.h).
std::string atlas_path(const std::string& rbvh_path);

/// What a pair contains beside its levels.
struct PairHeader {
  std::uint16_t major = 0, minor = 0;
  std::uint64_t hierarchy_bytes = 0, hierarchy_hash = 0;
  std::uint64_t atlas_bytes = 0, atlas_hash = 0;
  std::size_t levels = 0;  ///< all, those that were not read too
  std::string atlas_file;  ///< where it was found: atlas_path(), or what addressed_path() makes of that
};

/// Which of a pair's levels are read: their names, of all names. May throw.
using LevelFilter = std::function<std::vector<std::string>(const std::vector<std::string>& names)>;

/// Reads and checks a pair: identifier, length, hash, version, verifier, every range, the atlas's length,
/// hash and geometry. Where a writer replaces the pair meanwhile, the result is the old one or the new one.
/// Hostile input is expected. Throws Error(kInput) naming the first fault in a sentence. `check` sees the
/// pair when it has no texels yet, and may throw; it may be called again. Levels that `choose`, if given,
/// leaves out are neither decoded nor checked, and not in the result.
Rbvh read_rbvh(const std::string& path, PairHeader* header = nullptr,
               const std::function<void(const Rbvh&)>& check = {}, const LevelFilter& choose = {});

/// As read_rbvh, but of the hierarchy alone: layers have no texels yet. `path` is for messages.
Rbvh decode_hierarchy(std::span<const std::byte> file, const std::string& path, PairHeader& header,
                      const LevelFilter& choose = {});

struct RbvhBytes {
  std::uint64_t hierarchy = 0, atlas = 0;
  std::vector<std::uint64_t>
      levels;  ///< each level's nodes, leaves and layers; what is left are names and headers
};

/// Writes both files; at every moment, a reader finds the old pair or the new one, whole (io/file_set.h).
/// Where `path` is a link, both go beside what it leads to. Identical input gives identical bytes. Throws
/// Error(kFailure): the old pair is as it was. Where both together would be over `most_bytes`, nothing is
/// written; the result tells.
RbvhBytes write_rbvh(const std::string& path, const Rbvh& rbvh, bool overwrite,
                     std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max());

/// Writes the finest levels that fit into `most_bytes`, both files together (choose_levels_by_bytes()), and
/// leaves `rbvh` with these. Where even the smallest does not fit, `add_coarser`, if given, may add levels.
/// Throws Error(kBudget) where none fits; `file` is for that message.
RbvhBytes write_rbvh_within(const std::string& path, Rbvh& rbvh, bool overwrite, std::uint64_t most_bytes,
                            const std::string& file, const std::function<void(Rbvh&)>& add_coarser = {});

/// Throws the same Error as write_rbvh() would for an output that cannot be, before any work is done.
void check_rbvh_output(const std::string& path, bool overwrite);

}  // namespace rbvh
