#include "rbvh/version.h"

namespace rbvh {

const char* version() { return RBVH_VERSION; }

}  // namespace rbvh
