// What a user of the command line can do about an error: the library's remedies as options' names.
#pragma once

#include <string>

#include "pipeline/base/error.h"

namespace rbvh {

/// The error's one line with its remedy behind: "a.png: exists already; use --force to replace it".
std::string error_line(const Error& error);

}  // namespace rbvh
