#include "pipeline/proxy/proxy_words.h"

#include <bit>

#include "pipeline/base/error.h"
#include "pipeline/base/words.h"
#include "pipeline/proxy/check_proxy.h"

namespace rbvh {

std::uint32_t parse_tile_side(std::string_view text) {
  const auto side = static_cast<std::uint32_t>(parse_integer_between(text, 3, 1025));
  if (!std::has_single_bit(side - 1))
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is none of 3, 5, 9, 17, 33, 65 ... 1025");
  return side;
}

double parse_displacement(std::string_view text) {
  return parse_between(text, -double{kLargestProxyValue}, double{kLargestProxyValue});
}

double parse_percent(std::string_view text) {
  parse_above_zero(text);
  return parse_percent_or_none(text);
}

double parse_percent_or_none(std::string_view text) { return parse_between(text, 0, 100) / 100; }

}  // namespace rbvh
