#include "pipeline/base/error.h"

#include <cstdio>
#include <cstdlib>

namespace rbvh {
namespace {

std::string one_line(const std::string& file, FilePlace place, const std::string& message) {
  std::string line;
  if (!file.empty()) line.append(file).append(": ");
  if (!place.unit.empty())
    line.append(place.unit).append(" ").append(std::to_string(place.number)).append(": ");
  return line + message;
}

}  // namespace

Error::Error(ErrorKind kind, const std::string& file, FilePlace place, const std::string& message,
             Remedy remedy)
    : std::runtime_error(one_line(file, place, message)),
      kind_(kind),
      remedy_(remedy),
      place_(place),
      file_(file),
      message_(message) {}

void check_failed(const char* expression, const char* file, int line) {
  std::fprintf(stderr, "rbvh: internal error: %s (%s:%d); please report this\n", expression, file, line);
  std::abort();
}

}  // namespace rbvh
