#include "pipeline/render/look.h"

#include "pipeline/base/error.h"
#include "pipeline/base/words.h"

namespace rbvh {
namespace {

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
  throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' " + why);
}

}  // namespace

View parse_view(std::string_view text) {
  if (const auto view = find_view(text)) return *view;
  refuse(text, "is none of front, back, left, right, top, bottom, iso, best, sensor");
}

std::optional<Vec3f> parse_background(std::string_view text) {
  if (text == "transparent") return std::nullopt;
  if (const auto color = parse_color(text)) return color;
  refuse(text,
         "is neither transparent nor a colour: white, black, grey, #rrggbb, or three numbers from 0 to 1");
}

ValueRange parse_range(std::string_view text) {
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos) refuse(text, "is not two numbers, such as 0,1");
  const ValueRange range{static_cast<float>(parse_number(text.substr(0, comma))),
                         static_cast<float>(parse_number(text.substr(comma + 1)))};
  if (!(range.lo < range.hi)) refuse(text, "has a first number that is not below the second");
  return range;
}

SheetSize parse_sheet(std::string_view text) {
  const std::size_t by = text.find('x');
  if (by == std::string_view::npos) refuse(text, "is not columns and rows, such as 4x3");
  const auto side = [](std::string_view word) {
    return static_cast<std::size_t>(parse_integer_between(word, 1, 100));
  };
  return {side(text.substr(0, by)), side(text.substr(by + 1))};
}

}  // namespace rbvh
