#include "cli/layer_options.h"

#include <algorithm>
#include <cmath>

namespace rbvh {

void warn_of_infinite(Context& context, const std::string& file, std::span<const float> values) {
  const auto infinite = std::count_if(values.begin(), values.end(), [](float v) { return std::isinf(v); });
  if (infinite > 0)
    warn(context, file + ": " + counted(static_cast<std::uint64_t>(infinite), "infinite value") +
                      ", taken for none (as nan is)");
}

void warn_of_infinite(Context& context, const std::string& file, const Scan& scan,
                      const std::string& property) {
  for (const ScalarProperty& each : scan.properties)
    if (each.name == property) warn_of_infinite(context, file, each.values);
}

}  // namespace rbvh
