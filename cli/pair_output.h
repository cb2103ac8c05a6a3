// What the stages that write a pair share: how it may be named, and their last words.
#pragma once

#include <string>
#include <vector>

#include "cli/common.h"
#include "io/rbvh_file.h"

namespace rbvh {

/// Throws Error(kUsage) where --output is named as another kind of file, and as check_rbvh_output() does.
void check_pair_output(const Context& context);

/// Of a stage that changes a pair: makes --output optional.
void add_change_output(CLI::App& stage);
/// Where it writes: --output, else the pair itself, which --force must allow as it does any overwriting.
/// Checks that it can, and that no input is overwritten, `others` neither.
std::string change_output(Context& context, const std::string& pair, std::vector<std::string> others);

/// Writes the pair and reports it.
RbvhBytes write_pair(Context& context, const std::string& output, const Rbvh& rbvh, const std::string& what);

/// Says that `output` was written and `what` it holds; its bytes go to the report.
void report_pair(Context& context, const std::string& output, const RbvhBytes& bytes,
                 const std::string& what);

}  // namespace rbvh
