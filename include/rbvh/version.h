// The library's version.
#pragma once

#define RBVH_VERSION_MAJOR 0
#define RBVH_VERSION_MINOR 1
#define RBVH_VERSION_PATCH 0

#pragma GCC visibility push(default)
namespace rbvh {

/// Of the library that is linked, such as "0.1.0". Headers and library fit while major and minor agree.
const char* version();

}  // namespace rbvh
#pragma GCC visibility pop
