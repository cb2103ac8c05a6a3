#include "io/obj_materials.h"

#include <filesystem>

#include "io/input_file.h"
#include "io/obj_grammar.h"
#include "io/texture_files.h"

namespace rbvh {
namespace {

constexpr std::uintmax_t kMostBytes = 64u << 20;

/// How many words belong to an option; 0: up to three numbers.
int words_of(std::string_view option) {
  if (option == "-o" || option == "-s" || option == "-t") return 0;
  return option == "-mm" ? 2 : 1;
}

/// "-clamp on -s 2 2 brick wall.png"
ObjMap parse_map(std::string_view text, const std::string& file) {
  ObjMap map;
  TextCursor in(text, file);
  for (;;) {
    in.skip_spaces();
    const char* const start = in.at;
    const std::string_view option = in.word();
    if (option.size() < 2 || option[0] != '-') {
      in.at = start;
      break;
    }
    double numbers[3] = {};
    int count = 0;
    for (; words_of(option) == 0 && count < 3; ++count) {
      TextCursor next = in;
      const std::string_view word = next.word();
      if (read_number(word.data(), word.data() + word.size(), numbers[count]) != word.data() + word.size() ||
          word.empty())
        break;
      in = next;
    }
    for (int i = 0; i < words_of(option); ++i)
      if (const std::string_view word = in.word(); option == "-clamp" && word == "on")
        map.wrap = TextureWrap::kClamp;
    if (option == "-s" && count > 0) map.scale = {numbers[0], count > 1 ? numbers[1] : 1};
    if (option == "-o" && count > 0) map.offset = {numbers[0], count > 1 ? numbers[1] : 0};
  }
  std::string_view name = trimmed({in.at, in.remaining()});
  if (name.size() > 1 && name.front() == '"' && name.back() == '"') name = name.substr(1, name.size() - 2);
  map.image = std::string(name);
  return map;
}

}  // namespace

std::map<std::string, ObjMap> read_obj_materials(std::string_view bytes, const std::string& file) {
  std::map<std::string, ObjMap> all;
  std::string material;
  for (ObjGrammar in(bytes, file); in.next();) {
    if (in.key() == "newmtl") material = std::string(trimmed(in.rest()));
    if (in.key() != "map_Kd" && in.key() != "map_kd") continue;
    ObjMap map = parse_map(in.rest(), file);
    if (!map.image.empty()) all[material] = std::move(map);
  }
  return all;
}

bool load_obj_materials(const std::string& file, std::string_view name, std::map<std::string, ObjMap>& all) {
  const auto add = [&](std::string_view one) {
    const std::optional<std::string> path = find_beside(file, one);
    std::error_code code;
    if (!path || std::filesystem::file_size(*path, code) > kMostBytes || code) return false;
    try {
      const InputBytes bytes = read_input(*path);
      all.merge(read_obj_materials(bytes.view(), *path));
    } catch (const Error&) {  // UTF-16, or unreadable: as good as not there
      return false;
    }
    return true;
  };
  name = trimmed(name);
  if (add(name)) return true;
  bool found = false;
  TextCursor words(name, file);
  for (std::string_view word = words.word(); !word.empty(); word = words.word())
    if (word != name) found |= add(word);
  return found;
}

}  // namespace rbvh
