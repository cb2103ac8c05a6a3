// --tracer and --builder: how a scan is cast exactly.
#pragma once

#include <optional>
#include <string>

#include "cli/subject.h"
#include "pipeline/trace/trace_exact.h"

namespace rbvh {

struct ExactOptions {
  std::optional<ExactTraversal> tracer;
  std::optional<ExactBuilder> builder;
};

/// Declares both. `--tracer list` prints the names, one first on each line, and ends the stage with success.
void add_exact_options(CLI::App& stage, ExactOptions& options);

/// By name. Throws Error(kUsage).
ExactTraversal parse_tracer(std::string_view name);

/// What the words come to for `tracer` (default: as the options say). Throws Error(kUsage) where tracer and
/// builder do not fit.
ExactConfig exact_config(const ExactOptions& options, std::optional<ExactTraversal> tracer = {});

/// Throws Error(kBudget) where --memory has no room for a scan's hierarchy.
void check_exact_budget(const Context& context, const Subject& subject, const ExactConfig& config);

/// Throws Error(kUsage) where the words are for a scan and the subject is a pair, or the subject is a cloud
/// and the tracer takes triangles only; a scan's budget is checked, too.
void check_exact_options(const Context& context, const ExactOptions& options, const ExactConfig& config,
                         const Subject& subject);

/// Says in the report how a scan was cast.
void report_exact(Context& context, const ExactConfig& config);

}  // namespace rbvh
