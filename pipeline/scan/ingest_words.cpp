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

}  // namespace rbvh
