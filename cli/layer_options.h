// What paint, sample and build share about layers.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "io/npy.h"

namespace rbvh {

/// "--layer-scale": texels of the layer to one of the heights', 1/16 to 16.
double parse_layer_scale(std::string_view text);

/// 1 to 32 of A-Z a-z 0-9 _ -, as the format has it.
std::string parse_layer_name(std::string_view text);
std::vector<std::string> parse_layer_names(std::string_view text);

/// A distance in scan units, at least 0.
float parse_distance(std::string_view text);

/// Says how many of the values are infinite, which no layer can hold.
void warn_of_infinite(Context& context, const std::string& file, std::span<const float> values);

/// The same of a scan's vertex property, where it has one of that name.
void warn_of_infinite(Context& context, const std::string& file, const Scan& scan,
                      const std::string& property);

}  // namespace rbvh
