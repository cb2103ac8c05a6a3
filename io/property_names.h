// What vertex properties are called: every program has its own spelling of x, of a normal and of a colour.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace rbvh {

/// Indices of three names that belong together.
using NameTriple = std::array<std::size_t, 3>;

std::string lower(std::string_view text);

/// Lower case, without units in brackets, only letters and digits: "Normal_X [m]" is "normalx".
std::string plain_name(std::string_view name);

/// The names' x, y and z, or easting, northing and height, in any case and spelling; empty names are none.
std::optional<NameTriple> find_position(std::span<const std::string> names);
std::optional<NameTriple> find_normal(std::span<const std::string> names);
std::optional<NameTriple> find_color(std::span<const std::string> names);

/// Latitude and longitude are among them: degrees, which no position can be made of.
bool has_degrees(std::span<const std::string> names);

/// Whether a text is likely to name a column: a coordinate, part of a normal or colour, or a usual scalar.
bool is_known_name(std::string_view name);

}  // namespace rbvh
