#include "pipeline/scan/ingest_words.h"

#include "pipeline/base/words.h"

namespace rbvh {

Outliers parse_outliers(std::string_view text) {
  const std::vector<std::string> words = parse_list(text);
  if (words.size() != 2) throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not K,SIGMA");
  Outliers outliers{.neighbors = static_cast<std::size_t>(parse_positive(words[0])),
                    .sigma = parse_number(words[1])};
  if (outliers.sigma <= 0) throw Error(ErrorKind::kUsage, "", "SIGMA must be above 0");
  return outliers;
}

std::vector<std::uint8_t> parse_classes(std::string_view text) {
  std::vector<std::uint8_t> classes;
  for (const std::string& word : parse_list(text)) {
    const std::int64_t number = parse_integer(word);
    if (number < 0 || number > 255) throw Error(ErrorKind::kUsage, "", "'" + word + "' is not 0 to 255");
    classes.push_back(static_cast<std::uint8_t>(number));
  }
  return classes;
}

}  // namespace rbvh
