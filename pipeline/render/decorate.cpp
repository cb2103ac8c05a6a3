#include "pipeline/render/decorate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/srgb.h"
#include "pipeline/base/text.h"
#include "pipeline/base/units.h"
#include "pipeline/base/vector_math.h"
#include "pipeline/rbvh/rbvh.h"
#include "pipeline/trace/camera_rays.h"
#include "rbvh/scan.h"

namespace rbvh {
namespace {

constexpr std::size_t kRows = 8;
constexpr Vec3f kInk{0.16f, 0.16f, 0.18f}, kGridInk{0.45f, 0.45f, 0.48f};  // sRGB
constexpr Vec3f kAxes[] = {{0.85f, 0.22f, 0.22f}, {0.25f, 0.66f, 0.25f}, {0.24f, 0.40f, 0.90f}};

/// A colour as the picture's values have it.
Vec3f ink(const Image& picture, Vec3f srgb) {
  if (picture.kind != Image::Kind::kColor) return srgb;
  return {srgb_to_linear(srgb.x), srgb_to_linear(srgb.y), srgb_to_linear(srgb.z)};
}

void put_behind(float* pixel, Vec3f color, float part) {
  const float room = (1 - pixel[3]) * part;
  for (int c = 0; c < 3; ++c) pixel[c] += color[c] * room;
  pixel[3] += room;
}

void put_over(float* pixel, Vec3f color, float part) {
  for (int c = 0; c < 3; ++c) pixel[c] = pixel[c] * (1 - part) + color[c] * part;
  pixel[3] = pixel[3] * (1 - part) + part;
}

/// 1, 2 or 5 times a power of ten, at most `value`.
double round_length(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {5., 2.})
    if (step * power <= value) return step * power;
  return power;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

/// Lines of a grid at round distances on the plane below the object, fading out around it.
void draw_grid(const Camera& camera, const Asset& asset, Vec3d up, Image& picture) {
  const double size = static_cast<double>(asset.bounds.diagonal());
  if (!(size > 0)) return;
  const double cell = round_length(size / 8);
  const Vec3d lo = static_cast<Vec3d>(asset.bounds.lo), hi = static_cast<Vec3d>(asset.bounds.hi);
  const Vec3d bottom{up.x > 0 ? lo.x : hi.x, up.y > 0 ? lo.y : hi.y, up.z > 0 ? lo.z : hi.z};
  const Vec3d center = static_cast<Vec3d>(asset.bounds.center());
  const double height = dot(bottom, up);
  Vec3f xf, yf;
  make_frame(static_cast<Vec3f>(up), xf, yf);
  // Along the file's axes, where `up` is one of them.
  const Vec3d x = std::abs(up.x) > 0.99                    ? Vec3d{0, 1, 0}
                  : std::abs(up.y) + std::abs(up.z) > 0.99 ? Vec3d{1, 0, 0}
                                                           : static_cast<Vec3d>(xf);
  const Vec3d along = normalized(x - up * dot(x, up)), across = cross(up, along);
  const CameraRays rays = camera_rays(camera, picture.width, picture.height);
  const double pixel = static_cast<double>(length(array3(rays.up)));
  const Vec3f color = ink(picture, kGridInk);
  parallel_for(picture.height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row)
      for (std::size_t column = 0; column < picture.width; ++column) {
        float* out = picture.at(column, row);
        if (out[3] >= 1) continue;
        const Ray ray = pixel_ray(rays, static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row));
        const Vec3d origin = static_cast<Vec3d>(array3(ray.origin)),
                    way = static_cast<Vec3d>(array3(ray.direction));
        const double falling = dot(way, up), t = (height - dot(origin, up)) / falling;
        if (!(t > 0 && std::isfinite(t))) continue;
        const Vec3d point = origin + way * t - center;
        const double footprint = pixel * t;
        const double fade = std::clamp(2 - length(point - up * dot(point, up)) / (0.75 * size), 0., 1.);
        double line = 0;
        for (const Vec3d& axis : {along, across}) {
          // A pixel is longer on the plane where it is looked at aslant, but not along the plane's
          // horizontal.
          const double aslant = std::hypot(1., dot(way, axis) / std::max(0.02, std::abs(falling)));
          const double place = dot(point + center, axis) / cell,
                       off = std::abs(place - std::round(place)) * cell;
          line = std::max(line, std::clamp(1.1 - off / (footprint * aslant), 0., 1.));
        }
        put_behind(out, color, static_cast<float>(line * fade * 0.6));
      }
  });
}

struct Point2 {
  double x, y;
};

/// A line `width` pixels wide, smooth at its sides.
void draw_line(Image& picture, Point2 a, Point2 b, double width, Vec3f color) {
  const double reach = width / 2 + 1;
  const auto first = [&](double p, double q) {
    return static_cast<std::ptrdiff_t>(std::floor(std::min(p, q) - reach));
  };
  const auto last = [&](double p, double q) {
    return static_cast<std::ptrdiff_t>(std::ceil(std::max(p, q) + reach));
  };
  const double dx = b.x - a.x, dy = b.y - a.y, squared = dx * dx + dy * dy;
  for (std::ptrdiff_t y = std::max<std::ptrdiff_t>(0, first(a.y, b.y));
       y < std::min<std::ptrdiff_t>(picture.height, last(a.y, b.y)); ++y)
    for (std::ptrdiff_t x = std::max<std::ptrdiff_t>(0, first(a.x, b.x));
         x < std::min<std::ptrdiff_t>(picture.width, last(a.x, b.x)); ++x) {
      const double px = static_cast<double>(x) + 0.5 - a.x, py = static_cast<double>(y) + 0.5 - a.y;
      const double s = squared > 0 ? std::clamp((px * dx + py * dy) / squared, 0., 1.) : 0;
      const double off = std::hypot(px - s * dx, py - s * dy);
      const double part = std::clamp(width / 2 + 0.5 - off, 0., 1.);
      if (part > 0)
        put_over(picture.at(static_cast<std::size_t>(x), static_cast<std::size_t>(y)), color,
                 static_cast<float>(part));
    }
}

struct Layout {
  double unit;  // pixels: the size of a text
  explicit Layout(const Image& picture) : unit(std::max(9., std::min(picture.width, picture.height) / 42.)) {}
};

void draw_axes(const Camera& camera, const Layout& layout, Image& picture, std::vector<Text>& texts) {
  const Vec3d back = normalized(camera.position - camera.focal_point);
  const Vec3d right = normalized(cross(camera.up, back)), up = cross(back, right);
  const double size = 2.6 * layout.unit;
  const Point2 middle{static_cast<double>(picture.width) - 1.8 * size,
                      static_cast<double>(picture.height) - 1.8 * size};
  std::array<int, 3> order{0, 1, 2};
  const auto axis = [](int i) { return Vec3d{i == 0 ? 1. : 0., i == 1 ? 1. : 0., i == 2 ? 1. : 0.}; };
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return dot(axis(a), back) < dot(axis(b), back); });
  for (const int i : order) {
    const double x = dot(axis(i), right), y = -dot(axis(i), up);
    draw_line(picture, middle, {middle.x + size * x, middle.y + size * y}, layout.unit / 5,
              ink(picture, kAxes[i]));
    texts.push_back({std::string(1, "XYZ"[i]), middle.x + 1.25 * size * x - 0.3 * layout.unit,
                     middle.y + 1.25 * size * y + 0.35 * layout.unit, layout.unit});
  }
}

std::string counts(const Asset& asset, const std::string& level) {
  if (const Scan* scan = asset.scan())
    return scan->is_cloud() ? counted(scan->positions.size(), "point")
                            : counted(scan->triangles.size(), "triangle");
  if (const Rbvh* rbvh = asset.rbvh())
    if (const Level* l = rbvh->find_level(level)) return counted(l->leaves.size(), "leaf");
  return {};
}

std::string units_of(const Asset& asset) {
  const std::string units = asset.scan()   ? asset.scan()->units
                            : asset.rbvh() ? asset.rbvh()->source.units
                                           : "";
  return unit_meters(units) ? " " + units : "";
}

/// Name and counts on top, a length at the bottom.
void draw_label(const Camera& camera, const Depicted& of, const Layout& layout, Image& picture,
                std::vector<Text>& texts) {
  std::string words = of.asset.name;
  if (of.asset.rbvh() != nullptr) words += "  " + of.level;
  const std::string count = counts(of.asset, of.level);
  if (!count.empty()) words += "  " + count;
  texts.push_back({words, layout.unit, 1.8 * layout.unit, layout.unit});
  const double pixel = 2 * std::tan(camera.view_angle / 2 * std::numbers::pi / 180) *
                       length(camera.focal_point - camera.position) / picture.height;
  const double scale = round_length(pixel * picture.width / 4);
  const double y = picture.height - 1.2 * layout.unit, x = layout.unit, end = x + scale / pixel;
  const Vec3f color = ink(picture, kInk);
  draw_line(picture, {x, y}, {end, y}, layout.unit / 7, color);
  for (const double tick : {x, end})
    draw_line(picture, {tick, y - layout.unit / 3}, {tick, y + layout.unit / 3}, layout.unit / 7, color);
  texts.push_back({number(scale) + units_of(of.asset), x, y - 0.6 * layout.unit, layout.unit});
}

void draw_bar(const Depicted& of, const Layout& layout, Image& picture, std::vector<Text>& texts) {
  const auto width = static_cast<std::size_t>(layout.unit),
             height = static_cast<std::size_t>(picture.height * 0.4);
  const std::size_t right =
      picture.width - std::min<std::size_t>(picture.width, static_cast<std::size_t>(1.5 * layout.unit));
  const std::size_t left = right - std::min(right, width),
                    top = static_cast<std::size_t>(picture.height * 0.15);
  for (std::size_t y = 0; y < height; ++y) {
    const float t = 1 - static_cast<float>(y) / static_cast<float>(std::max<std::size_t>(1, height - 1));
    const Vec3f color = ink(picture, map_color(of.map, t));
    for (std::size_t x = left; x < right; ++x) put_over(picture.at(x, top + y), color, 1);
  }
  for (int i = 0; i <= 2; ++i) {
    const double value =
        static_cast<double>(of.range->lo) +
        (static_cast<double>(of.range->hi) - static_cast<double>(of.range->lo)) * (1 - i / 2.);
    texts.push_back({number(value), static_cast<double>(left) - 0.4 * layout.unit,
                     static_cast<double>(top) + static_cast<double>(height) * i / 2. + 0.35 * layout.unit,
                     layout.unit, true});
  }
}

}  // namespace

std::vector<Text> decorate(const Decoration& decoration, const Camera& camera, const Depicted& of,
                           Image& picture) {
  RBVH_CHECK(picture.channels.size() == 4);
  std::vector<Text> texts;
  const Layout layout(picture);
  if (decoration.grid) draw_grid(camera, of.asset, of.up, picture);
  if (decoration.background) {
    const Vec3f color = ink(picture, *decoration.background);
    for (std::size_t i = 0; i < picture.pixels.size(); i += 4) put_behind(&picture.pixels[i], color, 1);
  }
  if (decoration.axis) draw_axes(camera, layout, picture, texts);
  if (decoration.label) draw_label(camera, of, layout, picture, texts);
  if (decoration.scalar_bar && of.range) draw_bar(of, layout, picture, texts);
  return texts;
}

Image make_sheet(const std::vector<Image>& pictures, std::size_t columns, std::size_t rows) {
  RBVH_CHECK(!pictures.empty() && pictures.size() <= columns * rows);
  std::uint32_t width = 0, height = 0;
  for (const Image& picture : pictures) {
    width = std::max(width, picture.width);
    height = std::max(height, picture.height);
  }
  Image sheet = make_image(pictures[0].kind, width * static_cast<std::uint32_t>(columns),
                           height * static_cast<std::uint32_t>(rows), {"R", "G", "B", "A"});
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const Image& picture = pictures[i];
    RBVH_CHECK(picture.channels.size() == 4 && picture.kind == sheet.kind);
    for (std::size_t y = 0; y < picture.height; ++y)
      std::copy_n(picture.at(0, y), 4 * std::size_t{picture.width},
                  sheet.at(i % columns * width, i / columns * height + y));
  }
  return sheet;
}

}  // namespace rbvh
