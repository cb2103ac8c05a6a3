// What was measured, as reports and `--json` have it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "pipeline/measure/measure_proxy.h"
#include "pipeline/measure/stored_fidelity.h"

namespace rbvh {

/// The shortest decimal that is this float: 0.85, not 0.8500000238418579. null where it is not finite.
nlohmann::ordered_json float_json(float value);

/// null where nothing was measured.
nlohmann::ordered_json fidelity_json(const LevelFidelity& fidelity);

nlohmann::ordered_json measure_json(const LevelMeasure& measure);

/// measure_json(), and what the level's file says: "stored", and "as_stored" (null where that was measured in
/// other views; else whether there is no find_difference(), which `difference` becomes).
nlohmann::ordered_json measure_json(const LevelMeasure& measure, const ViewsConfig& views, const Level& level,
                                    std::string& difference);

/// {"proxy_to_scan": {"rms_percent", "max_percent"}, "scan_to_proxy": ...}, in percent of the diagonal.
nlohmann::ordered_json proxy_measure_json(const ProxyMeasure& measure);

}  // namespace rbvh
