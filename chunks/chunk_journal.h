// What a build in chunks has done, so that a killed one can go on: a file in the folder of its parts.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "chunks/cell_files.h"
#include "io/parts_file.h"

namespace rbvh {

struct ChunkJournal {
  std::uint64_t key = 0;  ///< hash of the scan, the options and the program's version
  std::vector<Cell> cells;
  std::vector<CellCounts> counts;  ///< of the cells' files, which are all written
  double area = 0;                 ///< as ScanMap's
  float margin = 0;                ///< as CellPlan's
  std::vector<PairPart> parts;     ///< of the first cells, which are built
};

inline constexpr const char* kJournalName = "journal.json";
std::string journal_path(const std::string& folder);

/// Nothing where there is none, it is damaged, or of another key.
std::optional<ChunkJournal> read_journal(const std::string& folder, std::uint64_t key);

/// Replaces it as a whole. Throws Error(kFailure).
void write_journal(const std::string& folder, const ChunkJournal& journal);

}  // namespace rbvh
