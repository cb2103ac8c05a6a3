// A pair of many parts: NAME.rbvh is a table of pairs beside it, built of one scan in one frame
// (docs/file_format.md).
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/rbvh/rbvh.h"
#include "pipeline/scene/scene.h"
#include "rbvh/asset.h"
#include "rbvh/progress.h"

namespace rbvh {

/// What a table of parts begins with.
inline constexpr std::string_view kPartsMagic = "RBVHPARTS ";

/// A level of one part.
struct PartLevel {
  std::uint64_t leaves = 0;
  std::uint64_t bytes = 0;   ///< in the part's files
  std::uint64_t memory = 0;  ///< about, where it is cast at
  Bounds3f bounds;           ///< of its leaves
  float reached = 0;         ///< Level::reached
};

struct PairPart {
  std::string file;                           ///< the pair, relative to the table's folder
  std::uint64_t bytes = 0;                    ///< of both its files
  std::uint64_t hierarchy = 0, atlas = 0;     ///< the hashes that its files carry
  std::uint64_t vertices = 0, triangles = 0;  ///< of the scan, its own
  std::vector<PartLevel> levels;              ///< in the table's order
};

struct PartsTable {
  RbvhSource source;          ///< the whole scan
  std::string build_options;  ///< as Rbvh's
  struct Level {
    std::string name;
    float rho = 0, error = 0;
    float reached = 0;  ///< over all parts
  };
  std::vector<Level> levels;  ///< finest first
  std::vector<PairPart> parts;
};

/// More parts are an error.
inline constexpr std::size_t kMostParts = 1u << 16;

/// True for a file that starts as a table does.
bool is_parts(const std::string& path);

/// Hostile input is expected. Throws Error(kInput) naming the first fault.
PartsTable read_parts(const std::string& path);
PartsTable decode_parts(std::string_view text, const std::string& path);

/// As one output. Throws Error(kFailure).
void write_parts(const std::string& path, const PartsTable& table, bool overwrite);

/// One part as the table has it.
nlohmann::ordered_json part_to_json(const PairPart& part);
PairPart part_from_json(const nlohmann::json& json, const std::string& path);

/// Where the part's pair lies.
std::string part_path(const std::string& table_path, const PairPart& part);

/// Reads every part and holds it against the table. What there is, for CheckedFile::summary. Throws
/// Error(kInput) naming the first fault.
nlohmann::ordered_json check_parts(const std::string& path, const MemoryBudget& memory,
                                   const Progress& progress);

/// One level of all parts as a scene: parts are read when rays reach them, and leave by use where they would
/// take more than half the budget. One level is loaded: the finest, unless config.levels names another.
/// Throws Error(kUsage) for several, or one that is not there.
Asset load_parts(const std::string& path, const LoadConfig& config);

}  // namespace rbvh
