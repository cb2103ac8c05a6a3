// JSON from hostile input: text that nests deeper than its format is refused, because traversing and freeing
// it recurses.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

namespace rbvh {

/// Discarded (is_discarded()) where the text is no JSON or has more than `most_depth` levels;
/// `fault_byte`, where given, gets the byte where that was found.
nlohmann::json parse_shallow_json(std::string_view text, int most_depth, std::size_t* fault_byte = nullptr);

}  // namespace rbvh
