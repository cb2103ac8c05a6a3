// The colours of textured scans in a level: its layer `texture`, three channels of 8 bits at a resolution of
// their own.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "pipeline/rbvh/rbvh.h"
#include "rbvh/build.h"
#include "rbvh/progress.h"
#include "rbvh/scan.h"

namespace rbvh {

inline constexpr std::string_view kTextureLayer = "texture";

/// The level's layer of that name with three channels, or nullptr.
const Layer* texture_layer(const Level& level);

/// The mesh with vertices' colours of what its textures show there, averaged over the faces around: for all
/// that knows vertices' colours alone. Other vertices keep theirs, or are clay. Without places in textures
/// and further properties.
Scan colored_by_textures(const Scan& scan);

/// Texels to one of the heights', unless told otherwise: two, but no more than the images have.
double default_color_scale(const Level& level, const Scan& scan);

/// About how many bytes add_texture_layers() takes.
std::uint64_t texture_layer_memory(const Scan& scan, std::span<const LevelConfig> levels,
                                   std::optional<double> scale);

/// Gives each level what the scan's textures, else its vertices' colours, show at the point of the scan
/// nearest to each texel, averaged over the texel. Throws as make_layer().
void add_texture_layers(std::span<Level> levels, const Scan& scan, std::optional<double> scale,
                        const Progress& progress = {});

/// Rounds the values of such a layer, however they came, to 8 bits: it takes half the bytes then.
void round_texture(Layer& texture);

/// sRGB, of the three codes of a texel that has a value.
Color8 texture_bytes(const Layer& texture, const std::uint16_t* codes);

/// What the layer shows where a leaf is hit at (u, v) of its tile, in texels of the heights: linear light,
/// averaged over `width` (scan units). Nothing where none of the texels there has a value.
std::optional<Vec3f> texture_color(const Level& level, const Layer& texture, std::uint32_t leaf, float u,
                                   float v, float width);

}  // namespace rbvh
