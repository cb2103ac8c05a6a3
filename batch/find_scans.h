// Which scans a batch is of, and what each is called.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rbvh {

struct BatchScan {
  std::string path;  ///< absolute
  std::string name;  ///< relative, unique: the path within its folder, without its extension
};

struct FoundScans {
  std::vector<BatchScan> scans;  ///< sorted by name
  std::size_t others = 0;        ///< files in the folders that are no scans by their names
};

/// The files, and all scans below the folders; patterns are expanded. Hidden files and the folder `output`
/// are left out. Scans that differ by their extension alone keep it in their names ("wall.obj", "wall.ply").
/// Throws Error(kInput) for a name or a pattern without a file, Error(kUsage) for two files that would have
/// one name.
FoundScans find_scans(const std::vector<std::string>& inputs, const std::string& output);

/// Part `index` of `count`, from 1.
struct Shard {
  std::size_t index = 1, count = 1;
};

/// "I/N". Throws Error(kUsage).
Shard parse_shard(std::string_view text);

/// Each scan is in one part.
std::vector<BatchScan> shard(const std::vector<BatchScan>& scans, const Shard& part);

}  // namespace rbvh
