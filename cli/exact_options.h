// --tracer and --builder: how a scan is cast exactly.
#pragma once

#include <optional>
#include <string>

#include "cli/common.h"
#include "pipeline/trace/exact_words.h"
#include "rbvh/asset.h"

namespace rbvh {

struct ExactOptions {
  std::optional<ExactTraversal> tracer;
  std::optional<ExactBuilder> builder;
};

/// Declares both. `--tracer list` prints the names, one first on each line, and ends the stage with success.
void add_exact_options(CLI::App& stage, ExactOptions& options);

/// Throws Error(kUsage) where the words are for a scan and the asset is a pair, or the asset is a cloud and
/// the tracer takes triangles only.
void check_exact_options(const ExactOptions& options, const ExactConfig& config, const Asset& asset);

/// Says in the report how a scan was cast.
void report_exact(Context& context, const ExactConfig& config);

}  // namespace rbvh
