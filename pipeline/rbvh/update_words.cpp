#include "pipeline/rbvh/update_words.h"

#include <limits>
#include <string>
#include <vector>

#include "pipeline/base/words.h"

namespace rbvh {

PairPart parse_pair_part(std::string_view text) {
  constexpr std::string_view kObject = "object:";
  if (text.starts_with(kObject)) {
    const std::int64_t number = parse_integer(text.substr(kObject.size()));
    if (number < std::numeric_limits<std::int32_t>::min() ||
        number > std::numeric_limits<std::int32_t>::max())
      throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not an object's number");
    return {{}, static_cast<std::int32_t>(number)};
  }
  const auto refuse = [&](const char* wanted) {
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not " + wanted);
  };
  std::vector<double> numbers;
  try {
    for (const std::string& word : parse_list(text)) numbers.push_back(parse_number(word));
  } catch (const Error&) {
    numbers.clear();
  }
  if (numbers.size() != 6) refuse("a box x,y,z,x,y,z (two opposite corners) or object:N");
  Bounds3d box;
  box.add(Vec3d{numbers[0], numbers[1], numbers[2]});
  box.add(Vec3d{numbers[3], numbers[4], numbers[5]});
  const Vec3d e = box.extent();
  if (!(e.x > 0 && e.y > 0 && e.z > 0)) refuse("a box with a volume");
  return {box, {}};
}

}  // namespace rbvh
