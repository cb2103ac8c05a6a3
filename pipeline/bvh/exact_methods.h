// The exact hierarchies' builders and traversals by name: what the command line offers, what the
// equivalence matrix checks and the benchmark measures. A new one gets a line here and a case where it is
// built (build_exact.cpp) or flattened (trace_exact.cpp).
#pragma once

#include <optional>
#include <string_view>

namespace rbvh {

enum class TreeKind { kBvh, kKd };

enum class ExactBuilder { kSahBinned, kSah, kLbvh, kPloc, kKd };

struct ExactBuilderInfo {
  ExactBuilder builder;
  const char* name;
  TreeKind tree;
  const char* what;
  int bytes;  ///< in memory for a primitive, at most, with its place in the scan: measured while one is cast
};

/// Of the builders that fit a traversal the first is its default.
inline constexpr ExactBuilderInfo kExactBuilders[] = {
    {ExactBuilder::kSahBinned, "sah-binned", TreeKind::kBvh, "surface area heuristic, 16 bins, on the host",
     220},
    {ExactBuilder::kSah, "sah", TreeKind::kBvh, "surface area heuristic, every plane, on the host", 220},
    {ExactBuilder::kPloc, "ploc", TreeKind::kBvh,
     "nearest neighbours merged from the leaves up, on the device; SAH on top", 360},
    {ExactBuilder::kLbvh, "lbvh", TreeKind::kBvh, "Morton codes, on the device", 360},
    {ExactBuilder::kKd, "kd", TreeKind::kKd, "surface area heuristic, every plane, on the host", 410},
};

enum class ExactTraversal { kWide16, kBvhStack, kBvhTrail, kBvhParent, kKdStack, kKdPushdown, kKdBacktrack };

struct ExactTraversalInfo {
  ExactTraversal traversal;
  const char* name;
  TreeKind tree;
  const char* kernel;  ///< file
  bool discs;          ///< takes clouds
  const char* what;
};

/// The first is the default.
inline constexpr ExactTraversalInfo kExactTraversals[] = {
    {ExactTraversal::kWide16, "wide16", TreeKind::kBvh, "trace/trace_wide16", true,
     "16 boxes, 16 triangles or discs at once, with a stack (default)"},
    {ExactTraversal::kBvhStack, "bvh-stack", TreeKind::kBvh, "trace/trace_bvh_stack", false,
     "binary hierarchy, with a stack"},
    {ExactTraversal::kBvhTrail, "bvh-trail", TreeKind::kBvh, "trace/trace_bvh_trail", false,
     "binary hierarchy, without a stack: a bit a level, restarts"},
    {ExactTraversal::kBvhParent, "bvh-parent", TreeKind::kBvh, "trace/trace_bvh_parent", false,
     "binary hierarchy, without a stack: links to parents"},
    {ExactTraversal::kKdStack, "kd-stack", TreeKind::kKd, "trace/trace_kd_stack", false,
     "kd-tree, with a stack"},
    {ExactTraversal::kKdPushdown, "kd-pushdown", TreeKind::kKd, "trace/trace_kd_pushdown", false,
     "kd-tree, without a stack: restarts from as deep as can be"},
    {ExactTraversal::kKdBacktrack, "kd-backtrack", TreeKind::kKd, "trace/trace_kd_backtrack", false,
     "kd-tree, without a stack: links to parents"},
};

/// By name; nothing for any other word.
std::optional<ExactBuilderInfo> find_exact_builder(std::string_view name);
std::optional<ExactTraversalInfo> find_exact_traversal(std::string_view name);

const ExactTraversalInfo& info(ExactTraversal traversal);
const ExactBuilderInfo& info(ExactBuilder builder);
ExactBuilder default_builder(ExactTraversal traversal);

}  // namespace rbvh
