// What pictures look like, and from where, in words.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "pipeline/render/decorate.h"
#include "rbvh/view.h"

namespace rbvh {

struct SheetSize {
  std::size_t columns = 1, rows = 1;
};

struct Look {
  View view = View::kChosen;
  bool edges = false, hide_back = false;
  Decoration decoration;
  std::string font;                ///< a file; empty: a usual one
  ColoredValues colored;           ///< without a name: the surface's own colours
  std::optional<SheetSize> sheet;  ///< all pictures in one
};

// These throw Error(kUsage) with a line that quotes `text`.

View parse_view(std::string_view text);
/// "transparent" is none; else parse_color().
std::optional<Vec3f> parse_background(std::string_view text);
/// Two rising numbers with a comma between.
ValueRange parse_range(std::string_view text);
/// "4x3": columns and rows.
SheetSize parse_sheet(std::string_view text);

}  // namespace rbvh
