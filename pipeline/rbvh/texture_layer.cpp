#include "pipeline/rbvh/texture_layer.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/srgb.h"
#include "pipeline/rbvh/layer_codec.h"
#include "pipeline/rbvh/layer_grid.h"
#include "pipeline/rbvh/layers.h"
#include "pipeline/scan/linear_color.h"
#include "pipeline/scan/texture_sampler.h"
#include "rbvh/tracer.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 12;
/// Codes are 1 + a byte.
constexpr float kHighest = 65534.0f / 255;
constexpr int kMostTaps = 8;  ///< along either axis, of what a ray covers
constexpr double kMostScale = 2, kLeastScale = 1.0 / 16;

Color8 srgb_bytes(Vec3f linear) {
  const auto byte = [](float c) {
    return static_cast<std::uint8_t>(std::clamp(linear_to_srgb(c), 0.0f, 1.0f) * 255 + 0.5f);
  };
  return {byte(linear.x), byte(linear.y), byte(linear.z)};
}

std::uint8_t shown_byte(const Layer& texture, std::uint16_t code) {
  return static_cast<std::uint8_t>(std::clamp(decode(texture, code), 0.0f, 1.0f) * 255 + 0.5f);
}

/// Of a square of the triangle's area, twice.
float side_of(const Scan& scan, const Triangle& t) {
  const Vec3f a = scan.positions[t[0]];
  return std::sqrt(length(cross(scan.positions[t[1]] - a, scan.positions[t[2]] - a)));
}

/// Texels that the images have where faces show them.
double image_texels(const Scan& scan) {
  double texels = 0;
  for (const FaceTexture& face : scan.face_textures) {
    if (face.texture == FaceTexture::kNone) continue;
    const TextureImage& image = *scan.textures[face.texture].image;
    const auto& [a, b, c] = face.corners;
    const double across = static_cast<double>(b[0] - a[0]) * static_cast<double>(c[1] - a[1]) -
                          static_cast<double>(c[0] - a[0]) * static_cast<double>(b[1] - a[1]);
    texels += std::abs(across) / 2 * image.width * image.height;
  }
  return texels;
}

double scale_for(double rho, double texels) {
  return std::clamp(std::sqrt(2 * texels / rho), kLeastScale, kMostScale);
}

Vec3f vertex_color(const Scan& scan, const NearestPlaces::Place& at) {
  if (scan.colors.empty()) return kClay;
  Vec3f color{};
  for (std::size_t c = 0; c < 3; ++c)
    color = color + linear_color(scan.colors[scan.triangles[at.element][c]]) * at.weights[c];
  return color;
}

}  // namespace

const Layer* texture_layer(const Level& level) {
  const Layer* layer = find_layer(level, kTextureLayer);
  return layer != nullptr && layer->channels == 3 ? layer : nullptr;
}

Scan colored_by_textures(const Scan& scan) {
  const TextureSampler sampler(scan);
  std::vector<Vec3f> sums(scan.positions.size());
  std::vector<float> weights(scan.positions.size());
  for (std::size_t f = 0; f < scan.triangles.size(); ++f) {
    const float width = side_of(scan, scan.triangles[f]);
    for (std::size_t c = 0; c < 3; ++c) {
      std::array<float, 3> at{};
      at[c] = 1;
      const std::optional<Vec3f> color = sampler.color(f, at, width);
      if (!color) continue;
      const std::uint32_t vertex = scan.triangles[f][c];
      sums[vertex] = sums[vertex] + *color;
      weights[vertex] += 1;
    }
  }
  Scan colored;
  colored.positions = scan.positions;
  colored.shift = scan.shift;
  colored.units = scan.units;
  colored.normals = scan.normals;
  colored.triangles = scan.triangles;
  colored.object_ids = scan.object_ids;
  colored.textures = scan.textures;
  colored.colors = scan.colors;
  colored.colors.resize(scan.positions.size(), srgb_bytes(kClay));
  for (std::size_t i = 0; i < sums.size(); ++i)
    if (weights[i] > 0) colored.colors[i] = srgb_bytes(sums[i] * (1 / weights[i]));
  return colored;
}

double default_color_scale(const Level& level, const Scan& scan) {
  return scale_for(static_cast<double>(level.rho), image_texels(scan));
}

std::uint64_t texture_layer_memory(const Scan& scan, std::span<const LevelConfig> levels,
                                   std::optional<double> scale) {
  // Of a texel: its codes, and while it is filled its place and point.
  constexpr std::uint64_t kBytesPerTexel = 3 * sizeof(std::uint16_t), kWhileFilled = 32,
                          kBytesPerTriangle = 120;
  const double of_images = image_texels(scan);
  double all = 0, largest = 0;
  for (const LevelConfig& level : levels) {
    const auto rho = static_cast<double>(level.rho);
    const double side = scale.value_or(scale_for(rho, of_images)), texels = 2 * rho * side * side;
    all += texels;
    largest = std::max(largest, texels);
  }
  return static_cast<std::uint64_t>(all) * kBytesPerTexel +
         static_cast<std::uint64_t>(largest) * kWhileFilled + scan.triangles.size() * kBytesPerTriangle;
}

void add_texture_layers(std::span<Level> levels, const Scan& scan, std::optional<double> scale,
                        const Progress& progress) {
  RBVH_CHECK(!scan.is_cloud());
  const TextureSampler sampler(scan);
  const NearestPlaces places(scan);
  double done = 0;
  for (Level& level : levels) {
    report(progress, "textures", done++ / static_cast<double>(levels.size()));
    const double own_scale = scale.value_or(default_color_scale(level, scan));
    Layer layer = make_layer(level, std::string(kTextureLayer), 3, own_scale);
    layer.lo = 0;
    layer.hi = kHighest;
    const auto width = static_cast<float>(texel_side(level) / own_scale);
    const LayerPoints points = layer_points(level, layer);
    parallel_for(points.points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::optional<NearestPlaces::Place> at = places.find(points.points[i]);
        if (!at) continue;
        const std::optional<Vec3f> shown = sampler.color(at->element, at->weights, width);
        const Color8 bytes = srgb_bytes(shown ? *shown : vertex_color(scan, *at));
        for (std::size_t c = 0; c < 3; ++c)
          layer.texels[3 * points.texels[i] + c] = static_cast<std::uint16_t>(1 + bytes[c]);
      }
    });
    std::erase_if(level.layers, [](const Layer& other) { return other.name == kTextureLayer; });
    level.layers.push_back(std::move(layer));
  }
}

void round_texture(Layer& texture) {
  for (std::uint16_t& code : texture.texels)
    if (code != 0) code = static_cast<std::uint16_t>(1 + shown_byte(texture, code));
  texture.lo = 0;
  texture.hi = kHighest;
}

Color8 texture_bytes(const Layer& texture, const std::uint16_t* codes) {
  Color8 bytes;
  for (std::size_t c = 0; c < 3; ++c) bytes[c] = shown_byte(texture, codes[c]);
  return bytes;
}

std::optional<Vec3f> texture_color(const Level& level, const Layer& texture, std::uint32_t leaf, float u,
                                   float v, float width) {
  const LayerGrid grid(level, texture, leaf);
  const auto& row = level.leaves[leaf].to_tile;
  const float covered = width * length(Vec3f{row[0], row[1], row[2]});  // texels of the heights
  const int taps =
      std::clamp(static_cast<int>(std::ceil(covered * std::max(grid.per_u, grid.per_v))), 1, kMostTaps);
  Vec3f color{};
  float sum = 0;
  for (int i = 0; i < taps * taps; ++i) {
    const auto aside = [&](int tap) {
      return covered * ((static_cast<float>(tap) + 0.5f) / static_cast<float>(taps) - 0.5f);
    };
    const TexelQuad quad = grid.quad(u + aside(i % taps), v + aside(i / taps));
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint16_t* codes = &texture.texels[3 * quad.texels[k]];
      if (codes[0] == 0 || !(quad.weights[k] > 0)) continue;
      color = color + linear_color(texture_bytes(texture, codes)) * quad.weights[k];
      sum += quad.weights[k];
    }
  }
  if (!(sum > 0)) return {};
  return color * (1 / sum);
}

}  // namespace rbvh
