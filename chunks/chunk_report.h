// What the report of a build in chunks contains.
#pragma once

#include <nlohmann/json.hpp>

#include "rbvh/build_in_chunks.h"

namespace rbvh {

/// Counts, bytes and levels.
nlohmann::ordered_json chunks_json(const ChunkReport& report);

}  // namespace rbvh
