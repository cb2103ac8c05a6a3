#include "io/view_page.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "io/image.h"
#include "io/output_file.h"
#include "io/view_level.h"
#include "pipeline/base/error.h"
#include "pipeline/base/text.h"
#include "pipeline/rbvh/lod.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/frame.h"
#include "rbvh/viewer.h"

namespace rbvh {
namespace {

using Places = std::vector<std::pair<std::string_view, std::string>>;  // in the page's order

std::string fill_page(std::string_view page, const Places& places) {
  std::string filled;
  std::size_t at = 0;
  for (const auto& [name, text] : places) {
    const std::size_t place = page.find(name, at);
    RBVH_CHECK(place != std::string_view::npos);
    filled.append(page.substr(at, place - at)).append(text);
    at = place + name.size();
  }
  return filled.append(page.substr(at));
}

/// JSON that is safe inside of a script element, whatever names hold.
std::string script_json(const nlohmann::ordered_json& json) {
  std::string safe;
  for (const char c : json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace))
    c == '<' ? safe += "\\u003c" : safe += c;
  return safe;
}

std::string block_element(std::size_t number, const ByteVector& block) {
  return "<script type=\"application/octet-stream\" id=\"rbvh-level-" + std::to_string(number) + "\">" +
         encode_base64(block) + "</script>\n";
}

std::string still_element(const std::optional<Image>& still, const std::string& name) {
  if (!still) return {};
  const std::vector<std::byte> png = encode_image_png(*still);
  return "<img id=\"still\" alt=\"" + escape_html(name) + "\" src=\"data:image/png;base64," +
         encode_base64({reinterpret_cast<const std::uint8_t*>(png.data()), png.size()}) + "\">";
}

nlohmann::ordered_json page_meta(const Asset& pair) {
  const Rbvh& rbvh = *pair.rbvh();
  const auto numbers = [](const auto& v) { return nlohmann::ordered_json{v.x, v.y, v.z}; };
  const Bounds3f& bounds = rbvh.source.bounds;
  return {{"name", pair.name},
          {"units", rbvh.source.units == "unknown" ? "" : rbvh.source.units},
          {"shift", numbers(rbvh.source.shift)},
          {"up", numbers(pair.up_axis())},
          {"bounds", {{"lo", numbers(bounds.lo)}, {"hi", numbers(bounds.hi)}}},
          {"source", rbvh.source.name},
          {"primitives", rbvh.source.triangles > 0 ? rbvh.source.triangles : rbvh.source.vertices},
          {"levels", nlohmann::ordered_json::array()}};
}

/// The page with these of the levels, which are finest first.
std::string make_page(const Asset& pair, const std::vector<ViewLevel>& levels,
                      const std::vector<std::size_t>& chosen, const std::string& still) {
  nlohmann::ordered_json meta = page_meta(pair);
  std::string first, rest;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const ViewLevel& level = levels[chosen[chosen.size() - 1 - i]];
    meta["levels"].push_back(level.meta);
    (i == 0 ? first : rest) += block_element(i, level.block);
  }
  const std::string title = escape_html(pair.name);
  return fill_page(kViewerPage, {{"@TITLE@", title},
                                 {"@TITLE@", title},
                                 {"@THUMBNAIL@", still},
                                 {"@META@", script_json(meta)},
                                 {"@FIRST@", first},
                                 {"@REST@", rest}});
}

}  // namespace

std::string encode_base64(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = word << 8 | (k < count ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kLetters[word >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string escape_html(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    if (c == '&')
      safe += "&amp;";
    else if (c == '<')
      safe += "&lt;";
    else if (c == '>')
      safe += "&gt;";
    else if (c == '"')
      safe += "&quot;";
    else
      safe += c;
  }
  return safe;
}

ViewBytes write_view(const std::string& path, const Asset& pair, const ViewConfig& config, bool overwrite) {
  if (pair.rbvh() == nullptr) throw Error(ErrorKind::kUsage, pair.path, "is no pair; build one of it");
  OutputFile file(path, overwrite);
  const std::vector<Level>& levels = pair.rbvh()->levels;
  std::vector<ViewLevel> packed;
  std::vector<std::uint64_t> bytes;
  for (const Level& level : levels) {
    packed.push_back(pack_view_level(level, pair.path));
    // Its element, its description, and a comma; of these there is one less than of levels.
    bytes.push_back(block_element(levels.size() - 1, packed.back().block).size() +
                    script_json(packed.back().meta).size() + 1);
  }
  const std::string still = still_element(config.still, pair.name);
  const std::uint64_t own = make_page(pair, packed, {}, still).size() - 1;
  const std::vector<std::size_t> chosen =
      choose_levels_by_bytes(bytes, config.most_bytes > own ? config.most_bytes - own : 0);
  if (chosen.empty())
    throw Error(ErrorKind::kBudget, pair.path,
                "no level fits into " + format_bytes(config.most_bytes) +
                    "; a page with the smallest takes " +
                    format_bytes(own + *std::min_element(bytes.begin(), bytes.end())));
  const std::string page = make_page(pair, packed, chosen, still);
  file.write(std::string_view(page));
  file.commit();
  ViewBytes result;
  result.page = page.size();
  for (const std::size_t i : chosen) {
    result.levels.push_back(levels[i].name);
    result.level_bytes.push_back(bytes[i]);
    result.stored_bytes.push_back(levels[i].stored_bytes);
  }
  return result;
}

}  // namespace rbvh
