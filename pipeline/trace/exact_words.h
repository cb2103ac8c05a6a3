// How a scan is cast exactly, as a user says it: by the names of pipeline/bvh/exact_methods.h.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/trace/trace_exact.h"

namespace rbvh {

/// By name. Throws Error(kUsage) for any other word.
ExactBuilder parse_exact_builder(std::string_view name);
ExactTraversal parse_exact_traversal(std::string_view name);

/// "wide16,bvh-stack": two of them. Throws Error(kUsage).
std::vector<ExactTraversal> parse_two_traversals(std::string_view text);

/// "sah-binned, sah, ...": all of them, or those that fit.
std::string exact_builder_names();
std::string exact_builder_names(ExactTraversal traversal);

/// What is not given is the default, a builder that fits. Throws Error(kUsage) where the two do not fit.
ExactConfig exact_config(std::optional<ExactTraversal> traversal, std::optional<ExactBuilder> builder);

}  // namespace rbvh
