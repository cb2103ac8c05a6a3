#include "io/property_names.h"

#include <algorithm>
#include <vector>

namespace rbvh {
namespace {

/// Plain names with blanks between.
using Words = std::string_view;

constexpr Words kX =
    "x xcoord xcoordinate coordx coordinatex posx xpos positionx xposition position0 pointx pointsx "
    "point0 points0 px xm cartesianx coord0 coordinates0";
constexpr Words kY =
    "y ycoord ycoordinate coordy coordinatey posy ypos positiony yposition position1 pointy pointsy "
    "point1 points1 py ym cartesiany coord1 coordinates1";
constexpr Words kZ =
    "z zcoord zcoordinate coordz coordinatez posz zpos positionz zposition position2 pointz pointsz "
    "point2 points2 pz zm cartesianz coord2 coordinates2 elevation elev height altitude alt h up";
constexpr Words kEast = "easting east eastings utmeasting utme e";
constexpr Words kNorth = "northing north northings utmnorthing utmn n";
constexpr Words kNormal[3] = {"nx normalx xnormal normx normal0 normals0 normalsx",
                              "ny normaly ynormal normy normal1 normals1 normalsy",
                              "nz normalz znormal normz normal2 normals2 normalsz"};
constexpr Words kColor[3] = {"red r diffusered colorred colourred colorr redcolor rgb0 color0 rf",
                             "green g diffusegreen colorgreen colourgreen colorg greencolor rgb1 color1 gf",
                             "blue b diffuseblue colorblue colourblue colorb bluecolor rgb2 color2 bf"};
constexpr Words kOther =
    "intensity i id nr name point time gps timestamp alpha a classification class code radius "
    "reflectance amplitude gpstime pt pointid label returnnumber scanangle desc scan lat latitude "
    "relativetime lon long lng longitude normal pointnumber curvature range ring number rgb "
    "numberofreturns";

/// Calls `take` with each word until it returns true; whether it did.
template <class Take>
bool any_word(Words words, Take take) {
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(' '), words.size());
    if (take(words.substr(0, end))) return true;
    words.remove_prefix(std::min(end + 1, words.size()));
  }
  return false;
}

/// The names to look in: as they are spelt, and plain.
class Names {
 public:
  explicit Names(std::span<const std::string> names) : names_(names) {
    for (const std::string& name : names) plain_.push_back(plain_name(name));
  }

  /// One for each of the three sets. In a set earlier words count first, and a name spelt so before one that
  /// becomes so.
  std::optional<NameTriple> find(Words a, Words b, Words c) const {
    const auto x = find_one(a), y = find_one(b), z = find_one(c);
    return x && y && z ? std::optional(NameTriple{*x, *y, *z}) : std::nullopt;
  }
  bool any(Words words) const { return find_one(words).has_value(); }

 private:
  std::optional<std::size_t> find_one(Words words) const {
    std::optional<std::size_t> found;
    any_word(words, [&](std::string_view word) {
      for (std::size_t i = 0; i < names_.size() && !found; ++i)
        if (names_[i] == word) found = i;
      for (std::size_t i = 0; i < names_.size() && !found; ++i)
        if (plain_[i] == word) found = i;
      return found.has_value();
    });
    return found;
  }
  std::span<const std::string> names_;
  std::vector<std::string> plain_;
};

}  // namespace

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return result;
}

std::string plain_name(std::string_view name) {
  std::string plain;
  int depth = 0;
  for (const char c : lower(name)) {
    if (c == '(' || c == '[' || c == '{') ++depth;
    if (depth == 0 && ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'))) plain += c;
    if (c == ')' || c == ']' || c == '}') depth = std::max(0, depth - 1);
  }
  return plain;
}

std::optional<NameTriple> find_position(std::span<const std::string> names) {
  const Names in(names);
  const auto found = in.find(kX, kY, kZ);
  return found ? found : in.find(kEast, kNorth, kZ);
}

std::optional<NameTriple> find_normal(std::span<const std::string> names) {
  return Names(names).find(kNormal[0], kNormal[1], kNormal[2]);
}

std::optional<NameTriple> find_color(std::span<const std::string> names) {
  return Names(names).find(kColor[0], kColor[1], kColor[2]);
}

bool has_degrees(std::span<const std::string> names) {
  const Names in(names);
  return in.any("latitude lat latitudedeg latdeg") && in.any("longitude lon long lng longitudedeg londeg");
}

bool is_known_name(std::string_view name) {
  const std::string plain = plain_name(name);
  const auto is_it = [&](std::string_view word) { return word == plain; };
  for (const Words words : {kX, kY, kZ, kEast, kNorth, kNormal[0], kNormal[1], kNormal[2], kColor[0],
                            kColor[1], kColor[2], kOther})
    if (any_word(words, is_it)) return true;
  return false;
}

}  // namespace rbvh
