// Results in words and tables, for people to read.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/scan/ingest.h"

namespace rbvh {

/// "FILE: whole (2 levels, ...)": of CheckedFile.summary.
std::string file_line(const nlohmann::ordered_json& summary);

/// Of a list of measure_json(): a line for each figure, a column for each level.
std::string fidelity_table(const nlohmann::ordered_json& levels);

/// Of proxy_measure_json(): a line each way.
std::string distance_text(const nlohmann::ordered_json& distance);

/// What is left, what was removed, what was estimated and by how much positions were shifted: one to four
/// lines, of the counts that are not zero. `output` names what was written.
std::vector<std::string> ingest_lines(const std::string& output, const IngestReport& counts,
                                      const Scan& scan);

}  // namespace rbvh
