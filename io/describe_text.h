// What `info` prints for people to read.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace rbvh {

/// Of describe(): lines and tables. `with_bytes`: of a pair also where its bytes are.
std::string describe_text(const nlohmann::ordered_json& json, bool with_bytes);

}  // namespace rbvh
