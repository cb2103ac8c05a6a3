// What is drawn around an object: a background, a grid under it, axes, a label, a scale, a bar of colours.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/render/color_map.h"
#include "rbvh/asset.h"
#include "rbvh/camera.h"
#include "rbvh/image.h"

namespace rbvh {

struct Decoration {
  std::optional<Vec3f> background;  ///< sRGB; none: transparent
  bool grid = false, axis = false, label = false;
  bool scalar_bar = false;
};

/// Text in a picture, to be drawn by io/draw_text.h.
struct Text {
  std::string words;
  double x = 0, y = 0;  ///< pixels: the left end, or the right one, of its baseline
  double size = 12;     ///< pixels
  bool to_the_left = false;
};

/// What a picture is of, for its label and its colours' bar.
struct Depicted {
  const Asset& asset;
  const std::string& level;
  Vec3d up{0, 1, 0};
  ColorMap map = ColorMap::kViridis;
  std::optional<ValueRange> range;  ///< none: no bar
};

/// Draws all but the texts, which it returns. The picture has the channels R, G, B, A.
std::vector<Text> decorate(const Decoration& decoration, const Camera& camera, const Depicted& of,
                           Image& picture);

/// Pictures side by side, row by row, on transparent ground; as large as the largest each. All have R, G, B,
/// A and the same kind.
Image make_sheet(const std::vector<Image>& pictures, std::size_t columns, std::size_t rows);

}  // namespace rbvh
