#include "io/shallow_json.h"

namespace rbvh {
namespace {

// Ends the parser at the first level that is too deep.
struct TooDeep {};

}  // namespace

nlohmann::json parse_shallow_json(std::string_view text, int most_depth, std::size_t* fault_byte) {
  using nlohmann::json;
  const auto limit = [&](int depth, json::parse_event_t, json&) {
    if (depth > most_depth) throw TooDeep{};
    return true;
  };
  std::size_t byte = 0;
  try {
    return json::parse(text.begin(), text.end(), limit);
  } catch (const json::parse_error& error) {
    byte = error.byte;
  } catch (const json::exception&) {  // a number that no double holds
  } catch (const TooDeep&) {
  }
  if (fault_byte != nullptr) *fault_byte = byte;
  return json(json::value_t::discarded);
}

}  // namespace rbvh
