#include "pipeline/measure/image_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/srgb.h"

namespace rbvh {
namespace {

constexpr float kBackground = 0.214f;  // linear: mid grey in sRGB
constexpr std::size_t kRows = 16;
constexpr int kRadius = 5;
constexpr double kSigma = 1.5;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;  // the paper's, for values in [0, 1]

// Double: a variance is the small difference of two means of squares.
using Plane = std::vector<double>;

// As an 8-bit picture would show it: brighter than white is white, NaN is black.
double shown_value(float linear) {
  return linear > 0 ? static_cast<double>(linear_to_srgb(std::min(linear, 1.f))) : 0;
}

// sRGB values in [0, 1], three a pixel, over the background.
Plane shown(const Image& image) {
  const std::size_t pixels = std::size_t{image.width} * image.height;
  Plane out(pixels * 3);
  parallel_for(pixels, 1 << 14, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t c = 0; c < 3; ++c)
        out[i * 3 + c] = shown_value(image.pixels[i * 4 + c] + (1 - image.pixels[i * 4 + 3]) * kBackground);
  });
  return out;
}

Plane grey(const Plane& rgb) {
  Plane out(rgb.size() / 3);
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = 0.2126 * rgb[i * 3] + 0.7152 * rgb[i * 3 + 1] + 0.0722 * rgb[i * 3 + 2];
  return out;
}

std::array<double, 2 * kRadius + 1> gaussian() {
  std::array<double, 2 * kRadius + 1> weights{};
  double sum = 0;
  for (int i = -kRadius; i <= kRadius; ++i) sum += std::exp(-i * i / (2 * kSigma * kSigma));
  for (int i = -kRadius; i <= kRadius; ++i)
    weights[static_cast<std::size_t>(i + kRadius)] = std::exp(-i * i / (2 * kSigma * kSigma)) / sum;
  return weights;
}

// Along rows, then along columns; pixels at the edge are repeated outwards.
Plane blur(const Plane& in, std::size_t width, std::size_t height) {
  static const auto weights = gaussian();
  const auto pass = [&](const Plane& from, bool along_x) {
    Plane to(from.size());
    parallel_for(height, kRows, [&](std::size_t begin, std::size_t end) {
      const std::ptrdiff_t last = static_cast<std::ptrdiff_t>(along_x ? width : height) - 1;
      for (std::size_t y = begin; y < end; ++y)
        for (std::size_t x = 0; x < width; ++x) {
          double sum = 0;
          for (int k = -kRadius; k <= kRadius; ++k) {
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(along_x ? x : y) + k;
            const std::size_t clamped = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(at, 0, last));
            sum += weights[static_cast<std::size_t>(k + kRadius)] *
                   (along_x ? from[y * width + clamped] : from[clamped * width + x]);
          }
          to[y * width + x] = sum;
        }
    });
    return to;
  };
  return pass(pass(in, true), false);
}

Plane product(const Plane& a, const Plane& b) {
  Plane out(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) out[i] = a[i] * b[i];
  return out;
}

Plane ssim_map(const Plane& a, const Plane& b, std::size_t width, std::size_t height) {
  const Plane mean_a = blur(a, width, height), mean_b = blur(b, width, height);
  const Plane aa = blur(product(a, a), width, height), bb = blur(product(b, b), width, height),
              ab = blur(product(a, b), width, height);
  Plane out(a.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double ma = mean_a[i], mb = mean_b[i];
    const double variances = aa[i] - ma * ma + bb[i] - mb * mb, covariance = ab[i] - ma * mb;
    out[i] = (2 * ma * mb + kC1) * (2 * covariance + kC2) / ((ma * ma + mb * mb + kC1) * (variances + kC2));
  }
  return out;
}

}  // namespace

ImageError compare_images(const Image& a, const Image& b) {
  RBVH_CHECK(a.width == b.width && a.height == b.height && a.channels.size() == 4 && b.channels.size() == 4);
  const Plane rgb_a = shown(a), rgb_b = shown(b);
  const Plane similarity = ssim_map(grey(rgb_a), grey(rgb_b), a.width, a.height);
  double squares = 0, ssim = 0;
  std::size_t covered = 0;
  for (std::size_t i = 0; i < similarity.size(); ++i) {
    if (a.pixels[i * 4 + 3] <= 0 && b.pixels[i * 4 + 3] <= 0) continue;
    ++covered;
    ssim += similarity[i];
    for (std::size_t c = 0; c < 3; ++c) {
      const double d = rgb_a[i * 3 + c] - rgb_b[i * 3 + c];
      squares += d * d;
    }
  }
  ImageError error;
  if (covered > 0) {
    error.rmse = std::sqrt(squares / static_cast<double>(3 * covered));
    error.ssim = std::min(1.0, ssim / static_cast<double>(covered));  // equal pictures, rounded up
  }
  error.psnr = error.rmse > 0 ? -20 * std::log10(error.rmse) : std::numeric_limits<double>::infinity();
  return error;
}

}  // namespace rbvh
