#include "io/name_template.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

[[noreturn]] void refuse(std::string_view text, const std::string& what) {
  throw Error(ErrorKind::kUsage, std::string(text),
              what + "; the fields are {name}, {level}, {frame} and {frame:03}");
}

}  // namespace

NameTemplate::NameTemplate(std::string_view text) : text_(text) {
  std::string_view rest = text;
  for (;;) {
    const std::size_t brace = rest.find_first_of("{}");
    Piece piece{std::string(rest.substr(0, brace)), {}, 0};
    if (brace == std::string_view::npos) {
      pieces_.push_back(piece);
      return;
    }
    const std::size_t close = rest.find('}', brace);
    if (rest[brace] == '}' || close == std::string_view::npos) refuse(text, "a brace stands alone");
    std::string_view field = rest.substr(brace + 1, close - brace - 1);
    if (field.starts_with("frame:")) {
      const std::string_view width = field.substr(6);
      if (width.size() != 2 || width[0] != '0' || width[1] < '1' || width[1] > '9')
        refuse(text, "'" + std::string(field) + "' is no field");
      piece.digits = width[1] - '0';
      field = "frame";
    }
    if (field != "name" && field != "level" && field != "frame")
      refuse(text, "'" + std::string(field) + "' is no field");
    piece.field = field;
    pieces_.push_back(piece);
    rest.remove_prefix(close + 1);
  }
}

bool NameTemplate::has(std::string_view field) const {
  return std::any_of(pieces_.begin(), pieces_.end(),
                     [&](const Piece& piece) { return piece.field == field; });
}

std::string NameTemplate::fill(std::string_view name, std::string_view level, int frame) const {
  std::string filled;
  for (const Piece& piece : pieces_) {
    filled += piece.literal;
    if (piece.field == "name") filled += name;
    if (piece.field == "level") filled += level;
    if (piece.field == "frame") {
      const std::string number = std::to_string(frame);
      filled.append(static_cast<std::size_t>(std::max(0, piece.digits - static_cast<int>(number.size()))),
                    '0');
      filled += number;
    }
  }
  return filled;
}

void check_names_differ(const NameTemplate& names, const std::vector<std::string>& files, bool several_levels,
                        bool several_cameras) {
  const auto require = [&](bool several, const char* what, const char* field) {
    if (several && !names.has(field))
      throw Error(
          ErrorKind::kUsage, names.text(),
          std::string("several ") + what + " would go to one picture; put {" + field + "} in the name");
  };
  require(files.size() > 1, "files", "name");
  require(several_levels, "levels", "level");
  require(several_cameras, "cameras", "frame");
  std::set<std::string> stems;
  for (const std::string& file : files)
    if (!stems.insert(std::filesystem::path(file).stem().string()).second && !names.has("level"))
      refuse_same_name(file);
}

void refuse_same_name(const std::string& file) {
  throw Error(ErrorKind::kUsage, file,
              "another input has the same name without extension, so would its picture; render it by itself");
}

}  // namespace rbvh
