// JSON of strangers: bytes that nest deeper than a format does are refused, for whoever walks or frees them
// recurses.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

namespace rbvh {

/// Discarded (is_discarded()) where the text is no JSON or has more than `most_depth` levels;
/// `fault_byte`, where given, says where that shows.
nlohmann::json parse_shallow_json(std::string_view text, int most_depth, std::size_t* fault_byte = nullptr);

}  // namespace rbvh
