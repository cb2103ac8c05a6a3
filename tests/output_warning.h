// What an output warns of, for tests.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "rbvh/io.h"

namespace rbvh {

/// The lines that `write` gives to set_output_warning(), joined; nothing where it gives none.
inline std::string output_warning(const std::function<void()>& write) {
  std::string lines;
  set_output_warning([&](std::string_view line) { lines.append(lines.empty() ? "" : "\n").append(line); });
  const struct Restore {
    ~Restore() { set_output_warning({}); }
  } restore;
  write();
  return lines;
}

}  // namespace rbvh
