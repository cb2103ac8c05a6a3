#include "io/draw_text.h"

#include <filesystem>
#include <vector>

#include "io/image_module.h"

namespace rbvh {
namespace {

constexpr const char* kFolders[] = {"/usr/share/fonts", "/usr/local/share/fonts"};
constexpr const char* kFonts[] = {"truetype/dejavu/DejaVuSans.ttf",
                                  "truetype/liberation/LiberationSans-Regular.ttf",
                                  "truetype/liberation2/LiberationSans-Regular.ttf",
                                  "truetype/noto/NotoSans-Regular.ttf",
                                  "truetype/freefont/FreeSans.ttf",
                                  "dejavu-sans-fonts/DejaVuSans.ttf",
                                  "TTF/DejaVuSans.ttf"};

std::string usual_font() {
  std::error_code code;
  for (const char* folder : kFolders)
    for (const char* font : kFonts) {
      const std::filesystem::path path = std::filesystem::path(folder) / font;
      if (std::filesystem::exists(path, code)) return path.string();
    }
  return {};
}

}  // namespace

std::string draw_texts(std::span<const Text> texts, const std::string& font, Image& picture) {
  if (texts.empty()) return {};
  const std::string file = font.empty() ? usual_font() : font;
  if (file.empty()) return "there is no font to write with";
  std::vector<TextSpec> specs;
  for (const Text& text : texts)
    specs.push_back({text.words, static_cast<int>(text.x), static_cast<int>(text.y),
                     static_cast<int>(text.size), text.to_the_left});
  return image_module("").draw_text(picture.pixels.data(), picture.width, picture.height, specs, file);
}

}  // namespace rbvh
