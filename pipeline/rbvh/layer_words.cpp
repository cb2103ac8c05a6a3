#include "pipeline/rbvh/layer_words.h"

#include "pipeline/base/error.h"
#include "pipeline/base/words.h"
#include "pipeline/rbvh/check_rbvh.h"

namespace rbvh {

std::string parse_name(std::string_view text) {
  std::string name(text);
  if (!is_name(name))
    throw Error(ErrorKind::kUsage, "", "'" + name + "' is no name of 1 to 32 letters, digits, _ and -");
  return name;
}

std::vector<std::string> parse_names(std::string_view text) {
  std::vector<std::string> names = parse_list(text);
  for (const std::string& name : names) parse_name(name);
  return names;
}

double parse_layer_scale(std::string_view text) { return parse_between(text, 1.0 / 16, 16); }

}  // namespace rbvh
