// What a batch has done, as a table: a row a scan.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "batch/run_batch.h"

namespace rbvh {

/// {"version", "counts": {"scans", "done", "up_to_date", "failed"}, "scans": [{"name", "source", "state",
/// "bytes_in", "bytes_out", "seconds", "peak_bytes", "warnings", "levels", and of those that failed "error"
/// and, where a step did, "step" and "exit_code"}]}. Seconds and peaks are those of the last run of each
/// step.
nlohmann::ordered_json batch_json(const std::vector<ScanResult>& results);

/// The same rows with commas between; a level's error has a column of its own (Q0_error: rms over the
/// diagonal, as reached; as asked for where it was not measured).
std::string batch_csv(const nlohmann::ordered_json& table);

/// Writes both into the folder `output`: batch.json and batch.csv, of a part batch-I-of-N.*. Throws
/// Error(kFailure).
void write_tables(const std::string& output, const Shard& part, const nlohmann::ordered_json& table);

}  // namespace rbvh
