#include "pipeline/base/error.h"

#include <cstdio>
#include <cstdlib>

namespace rbvh {

void check_failed(const char* expression, const char* file, int line) {
  std::fprintf(stderr, "rbvh: internal error: %s (%s:%d); please report this\n", expression, file, line);
  std::abort();
}

}  // namespace rbvh
