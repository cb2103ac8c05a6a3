// What paint, sample and build share about layers.
#pragma once

#include <span>
#include <string>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "pipeline/rbvh/layer_words.h"

namespace rbvh {

/// Says how many of the values are infinite, which no layer can hold.
void warn_of_infinite(Context& context, const std::string& file, std::span<const float> values);

/// The same of a scan's vertex property, where it has one of that name.
void warn_of_infinite(Context& context, const std::string& file, const Scan& scan,
                      const std::string& property);

}  // namespace rbvh
