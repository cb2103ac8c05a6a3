#include "cli/look_options.h"

#include "pipeline/rbvh/layer_words.h"

namespace rbvh {

void add_look_options(CLI::App& stage, Look& look) {
  constexpr const char* kGroup = "Look (as f3d's)";
  const auto flag = [&](const char* name, bool& target, const char* help) {
    return stage.add_flag(name, target, help)->group(kGroup);
  };
  const auto add = [&](const char* name, auto& target, auto parse, const char* value, const char* help) {
    return add_parsed(stage, name, target, parse, value, help)->group(kGroup);
  };
  add("--view", look.view, parse_view, "WHICH",
      "front, back, left, right, top, bottom, iso, best or sensor (default: the sensor's of a cloud seen "
      "from "
      "one place, else the best of 20)")
      ->excludes("--camera-position");
  flag("--hide-back", look.hide_back, "back faces are not seen");
  flag("--edges", look.edges, "draws the edges of triangles and the borders of tiles");
  add("--color-layer", look.colored.name, parse_name, "NAME",
      "colours by a pair's layer of your own, or by a scan's vertex property");
  add("--color-map", look.colored.map, parse_choice<kColorMaps>, "NAME",
      "viridis (default), cividis or turbo, from least to most")
      ->needs("--color-layer");
  add("--range", look.colored.range, parse_range, "LEAST,MOST", "of the colours (default: the values')")
      ->needs("--color-layer");
  flag("--scalar-bar", look.decoration.scalar_bar, "shows the colours' values")->needs("--color-layer");
  add("--background", look.decoration.background, parse_background, "COLOR",
      "transparent (default), white, black, grey, #rrggbb, or R,G,B from 0 to 1");
  flag("--grid", look.decoration.grid, "a grid below the object, at round distances");
  flag("--axis", look.decoration.axis, "shows where X, Y and Z point");
  flag("--label", look.decoration.label, "name, counts and a scale");
  stage.add_option("--font-file", look.font, "of labels (default: DejaVu, Liberation or Noto Sans)")
      ->type_name("FILE")
      ->group(kGroup);
  add("--sheet", look.sheet, parse_sheet, "COLUMNSxROWS", "all pictures in one");
}

}  // namespace rbvh
