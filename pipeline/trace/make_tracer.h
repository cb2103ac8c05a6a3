// A tracer of the right kind for an asset: which level, and what it takes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pipeline/base/memory_budget.h"
#include "pipeline/scene/asset.h"
#include "pipeline/trace/trace_scene.h"
#include "pipeline/trace/tracer.h"

namespace rbvh {

struct TracerConfig {
  /// A pair's: one of choose_levels(); empty: the finest; "auto": for each ray the level that its footprint
  /// asks for. Ignored where there are no levels.
  std::string level;
  SceneConfig scene;  ///< how scans and proxies are cast, alone too
  float spread = 0;   ///< of "auto": the width of rays that are not a camera's over their length
};

/// `asset` must outlive the tracer. Throws Error(kUsage) for a level that is not there or a traversal that
/// does not fit, Error(kBudget) where the device cannot hold it.
std::unique_ptr<Tracer> make_tracer(const Device& device, const Asset& asset,
                                    const TracerConfig& config = {});

/// The names of the levels to cast at: `wanted` may be empty (the finest) or hold "all". For a scan: "exact";
/// for proxies and scenes: "scene"; `wanted` is ignored there. Throws Error(kUsage) for a level that is not
/// there. With `has_auto`, "auto" (alone) is one.
std::vector<std::string> choose_levels(const Asset& asset, const std::vector<std::string>& wanted,
                                       bool has_auto = false);

/// Throws Error(kBudget) where what casting takes beside the files is over the budget: hierarchies of scans,
/// maps of proxies, their patch cache.
void check_tracer_budget(const MemoryBudget& memory, const Asset& asset, const SceneConfig& config);

/// Throws Error(kInput) where leaves or primitives are more than a float32 can number.
void check_leaf_numbers(const Asset& asset, const std::string& level);

}  // namespace rbvh
