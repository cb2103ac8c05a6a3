// A tracer of the right kind for an asset: which level, and what it takes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pipeline/base/memory_budget.h"
#include "pipeline/scene/asset_content.h"
#include "pipeline/trace/trace_scene.h"
#include "rbvh/tracer.h"

namespace rbvh {

/// make_tracer() with all that can be set. `level` is one of choose_levels().
std::unique_ptr<Tracer> make_tracer(const Device& device, const Asset& asset, const std::string& level,
                                    const SceneConfig& config, float spread = 0);

/// The names of the levels to cast at: `wanted` may be empty (the finest) or hold "all". For a scan: "exact";
/// for proxies and scenes: "scene"; `wanted` is ignored there. Throws Error(kUsage) for a level that is not
/// there. With `has_auto`, "auto" (alone) is one.
std::vector<std::string> choose_levels(const Asset& asset, const std::vector<std::string>& wanted,
                                       bool has_auto = false);
/// The same of the levels that a pair has, without "auto"; `file` is for the message.
std::vector<std::string> choose_levels(const std::vector<std::string>& present,
                                       const std::vector<std::string>& wanted, const std::string& file);

/// Throws Error(kBudget) where what casting takes beside the files is over the budget: hierarchies of scans,
/// maps of proxies, their patch cache.
void check_tracer_budget(const MemoryBudget& memory, const Asset& asset, const SceneConfig& config);

/// Throws Error(kInput) where leaves or primitives are more than a float32 can number.
void check_leaf_numbers(const Asset& asset, const std::string& level);

}  // namespace rbvh
