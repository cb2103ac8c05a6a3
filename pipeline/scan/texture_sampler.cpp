#include "pipeline/scan/texture_sampler.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "pipeline/base/parallel_for.h"
#include "pipeline/base/srgb.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/scan/linear_color.h"

namespace rbvh {
namespace {

constexpr std::size_t kRows = 16;

std::uint8_t srgb_byte(float linear) {
  return static_cast<std::uint8_t>(std::clamp(linear_to_srgb(linear), 0.0f, 1.0f) * 255 + 0.5f);
}

/// Which texels of `from` one of `to` covers, and how much of the first and the last.
struct Span {
  std::uint32_t first = 0, last = 0;
  float first_share = 1, last_share = 1;

  Span(std::uint32_t at, std::uint32_t to, std::uint32_t from) {
    const double width = static_cast<double>(from) / to, lo = at * width, hi = lo + width;
    first = static_cast<std::uint32_t>(lo);
    last = std::min(from - 1, static_cast<std::uint32_t>(std::ceil(hi)) - 1);
    first_share = static_cast<float>(first + 1 - lo);
    last_share = static_cast<float>(hi - last);
  }
  float share(std::uint32_t i) const { return i == first ? first_share : i == last ? last_share : 1; }
};

std::vector<Color8> halved(const TexturePyramid::Level& from, std::uint32_t width, std::uint32_t height) {
  std::vector<Color8> texels(std::size_t{width} * height);
  parallel_for(height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      const Span rows(static_cast<std::uint32_t>(y), height, from.height);
      for (std::uint32_t x = 0; x < width; ++x) {
        const Span columns(x, width, from.width);
        Vec3f sum{};
        float weight = 0;
        for (std::uint32_t row = rows.first; row <= rows.last; ++row)
          for (std::uint32_t column = columns.first; column <= columns.last; ++column) {
            const float share = rows.share(row) * columns.share(column);
            sum = sum + linear_color(from.texels[std::size_t{row} * from.width + column]) * share;
            weight += share;
          }
        const Vec3f mean = sum * (1 / weight);
        texels[y * width + x] = {srgb_byte(mean.x), srgb_byte(mean.y), srgb_byte(mean.z)};
      }
    }
  });
  return texels;
}

/// Texel `i` of a row that goes on beside the image.
std::uint32_t wrapped(std::int64_t i, std::uint32_t size, TextureWrap how) {
  const std::int64_t n = size;
  if (how == TextureWrap::kClamp) return static_cast<std::uint32_t>(std::clamp<std::int64_t>(i, 0, n - 1));
  const std::int64_t period = how == TextureWrap::kMirror ? 2 * n : n;
  const std::int64_t at = (i % period + period) % period;
  return static_cast<std::uint32_t>(at < n ? at : period - 1 - at);
}

/// Into [0, period), or with kClamp near [0, 1]: whole numbers of texels stay exact.
double folded(float place, TextureWrap how) {
  if (how == TextureWrap::kClamp) return std::clamp(static_cast<double>(place), -1.0, 2.0);
  return std::fmod(static_cast<double>(place), 2.0);
}

Vec3f bilinear(const TexturePyramid::Level& level, const Texture& texture, double u, double v) {
  const double x = u * level.width - 0.5, y = (1 - v) * level.height - 0.5;
  const double x0 = std::floor(x), y0 = std::floor(y);
  const auto fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  Vec3f color{};
  for (int k = 0; k < 4; ++k) {
    const std::size_t column = wrapped(static_cast<std::int64_t>(x0) + k % 2, level.width, texture.wrap_u);
    const std::size_t row = wrapped(static_cast<std::int64_t>(y0) + k / 2, level.height, texture.wrap_v);
    const float weight = (k % 2 == 0 ? 1 - fx : fx) * (k / 2 == 0 ? 1 - fy : fy);
    color = color + linear_color(level.texels[row * level.width + column]) * weight;
  }
  return color;
}

/// Texels of the image in one scan unit, along both its axes in the mean.
float texel_density(const Scan& mesh, std::size_t face, const TexturePyramid::Level& image) {
  const Triangle& t = mesh.triangles[face];
  const Vec3f a = mesh.positions[t[0]];
  const Vec3f n = cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
  const auto& uv = mesh.face_textures[face].corners;
  const float across =
      (uv[1][0] - uv[0][0]) * (uv[2][1] - uv[0][1]) - (uv[2][0] - uv[0][0]) * (uv[1][1] - uv[0][1]);
  const float texels = std::abs(across) * static_cast<float>(image.width) * static_cast<float>(image.height);
  const float area = length(n);
  return area > 0 ? std::sqrt(texels / area) : 0;
}

}  // namespace

TexturePyramid make_pyramid(std::shared_ptr<const TextureImage> image) {
  TexturePyramid pyramid;
  pyramid.levels.push_back({image->width, image->height, image->texels.data()});
  pyramid.image = std::move(image);
  while (pyramid.levels.back().width > 1 || pyramid.levels.back().height > 1) {
    const TexturePyramid::Level from = pyramid.levels.back();
    const std::uint32_t width = (from.width + 1) / 2, height = (from.height + 1) / 2;
    pyramid.smaller.push_back(halved(from, width, height));
    pyramid.levels.push_back({width, height, pyramid.smaller.back().data()});
  }
  return pyramid;
}

TextureSampler::TextureSampler(const Scan& mesh) : mesh_(mesh) {
  std::map<const TextureImage*, std::shared_ptr<const TexturePyramid>> of_images;
  for (const Texture& texture : mesh.textures) {
    auto& pyramid = of_images[texture.image.get()];
    if (!pyramid) pyramid = std::make_shared<const TexturePyramid>(make_pyramid(texture.image));
    pyramids_.push_back(pyramid);
  }
}

std::optional<Vec3f> TextureSampler::color(std::size_t face, const std::array<float, 3>& weights,
                                           float width) const {
  if (mesh_.face_textures.empty()) return {};
  const FaceTexture& placed = mesh_.face_textures[face];
  if (placed.texture == FaceTexture::kNone) return {};
  const Texture& texture = mesh_.textures[placed.texture];
  const std::vector<TexturePyramid::Level>& levels = pyramids_[placed.texture]->levels;
  float u = 0, v = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    u += weights[c] * placed.corners[c][0];
    v += weights[c] * placed.corners[c][1];
  }
  const double fu = folded(u, texture.wrap_u), fv = folded(v, texture.wrap_v);
  const float covered = width * texel_density(mesh_, face, levels[0]);
  const float last = static_cast<float>(levels.size() - 1);
  const float level = covered > 1 ? std::min(std::log2(covered), last) : 0;
  const auto finer = static_cast<std::size_t>(level);
  const float share = level - static_cast<float>(finer);
  Vec3f color = bilinear(levels[finer], texture, fu, fv);
  if (share > 0) color = color * (1 - share) + bilinear(levels[finer + 1], texture, fu, fv) * share;
  if (!texture.times_colors || mesh_.colors.empty()) return color;
  Vec3f own{};
  for (std::size_t c = 0; c < 3; ++c)
    own = own + linear_color(mesh_.colors[mesh_.triangles[face][c]]) * weights[c];
  return times(color, own);
}

}  // namespace rbvh
