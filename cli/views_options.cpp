#include "cli/views_options.h"

namespace rbvh {
namespace {

std::uint32_t parse_side(std::string_view text) {
  return static_cast<std::uint32_t>(parse_integer_between(text, 16, 16384));
}

}  // namespace

void add_views_options(CLI::App& stage, ViewsConfig& views, const std::string& with) {
  add_parsed(stage, "--views", views.views, parse_positive, "N", "how many views to measure in (default: 8)")
      ->needs(with);
  add_parsed(stage, "--resolution", views.resolution, parse_side, "N",
             "pixels of such a view, both ways (default: 1024)")
      ->needs(with);
}

}  // namespace rbvh
