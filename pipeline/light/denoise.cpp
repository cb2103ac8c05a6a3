#include "pipeline/light/denoise.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/light/a_trous.h"
#include "pipeline/light/environment.h"

namespace rbvh {
namespace {

constexpr int kSteps = 5;
constexpr std::size_t kRows = 8;
constexpr float kLeastAlbedo = 0.02f;
constexpr float kDeviations = 3;  // of noise, that luminance may differ by
constexpr float kNormalExponent = 64;
constexpr float kDepth = 1;  // in units of the depth's own slope over the pixels between

struct Lit {
  Vec3f light;
  float variance = 0;
};

bool is_seen(const DenoiseGuide& guide) { return dot(guide.normal, guide.normal) > 0; }

Vec3f divisor(const DenoiseGuide& guide) {
  return {std::max(guide.albedo.x, kLeastAlbedo), std::max(guide.albedo.y, kLeastAlbedo),
          std::max(guide.albedo.z, kLeastAlbedo)};
}

struct Filter {
  const std::vector<DenoiseGuide>& guides;
  std::ptrdiff_t width, height;

  std::size_t at(std::ptrdiff_t x, std::ptrdiff_t y) const { return static_cast<std::size_t>(y * width + x); }

  // How much depth changes from a pixel to the next, where the surface goes on.
  float slope(std::ptrdiff_t x, std::ptrdiff_t y) const {
    const float depth = guides[at(x, y)].depth;
    float least = 1e30f;
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      const std::ptrdiff_t nx = x + dx, ny = y + dy;
      if (nx < 0 || ny < 0 || nx >= width || ny >= height || !is_seen(guides[at(nx, ny)])) continue;
      least = std::min(least, std::abs(guides[at(nx, ny)].depth - depth));
    }
    return least < 1e30f ? least : 0;
  }

  Lit pixel(const std::vector<Lit>& in, std::ptrdiff_t x, std::ptrdiff_t y, std::ptrdiff_t spacing) const {
    const DenoiseGuide& own = guides[at(x, y)];
    const Lit& center = in[at(x, y)];
    const float luminance_scale = 1 / (kDeviations * std::sqrt(center.variance) + 1e-4f);
    const float depth_scale =
        1 / (kDepth * slope(x, y) * static_cast<float>(spacing) * 2 + 1e-3f * own.depth);
    Lit sum;
    float weights = 0;
    for_each_tap(width, height, x, y, spacing, [&](std::size_t tap, float spline) {
      const DenoiseGuide& other = guides[tap];
      if (!is_seen(other)) return;
      const Lit& lit = in[tap];
      const float apart = std::abs(luminance(lit.light) - luminance(center.light)) * luminance_scale +
                          std::abs(other.depth - own.depth) * depth_scale;
      const float w =
          spline * std::exp(-apart) * std::pow(std::max(0.f, dot(own.normal, other.normal)), kNormalExponent);
      sum.light = sum.light + lit.light * w;
      sum.variance += lit.variance * w * w;
      weights += w;
    });
    if (!(weights > 0)) return center;
    return {sum.light * (1 / weights), sum.variance / (weights * weights)};
  }
};

}  // namespace

void denoise(Image& color, std::vector<DenoiseGuide> guides) {
  const std::size_t width = color.width, height = color.height;
  RBVH_CHECK(guides.size() == width * height && color.channels.size() == 4);
  std::vector<Lit> lit(guides.size()), next(guides.size());
  for (std::size_t i = 0; i < guides.size(); ++i) {
    if (!is_seen(guides[i])) continue;
    const float* p = &color.pixels[i * 4];
    const Vec3f by = divisor(guides[i]);
    lit[i].light = {p[0] / by.x, p[1] / by.y, p[2] / by.z};
    const float scale = luminance(by);
    lit[i].variance = guides[i].variance / (scale * scale);
  }
  const Filter filter{guides, static_cast<std::ptrdiff_t>(width), static_cast<std::ptrdiff_t>(height)};
  for (int step = 0; step < kSteps; ++step) {
    parallel_for(height, kRows, [&](std::size_t begin, std::size_t end) {
      for (std::size_t y = begin; y < end; ++y)
        for (std::size_t x = 0; x < width; ++x)
          if (is_seen(guides[y * width + x]))
            next[y * width + x] = filter.pixel(lit, static_cast<std::ptrdiff_t>(x),
                                               static_cast<std::ptrdiff_t>(y), std::ptrdiff_t{1} << step);
    });
    std::swap(lit, next);
  }
  for (std::size_t i = 0; i < guides.size(); ++i) {
    if (!is_seen(guides[i])) continue;
    const Vec3f by = divisor(guides[i]);
    for (int c = 0; c < 3; ++c) color.pixels[i * 4 + static_cast<std::size_t>(c)] = lit[i].light[c] * by[c];
  }
}

}  // namespace rbvh
