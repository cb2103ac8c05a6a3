#include "demo_shape.h"

#include <numbers>

namespace rbvh::demo {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kKnotMajor = 1.08f, kKnotMinor = 0.46f;
constexpr Vec3f kCupCenter{0, 0.02f, 0.02f};
constexpr float kPlinthTop = -1.17f;
constexpr float kRibbonReach = 0.40f;  // no part of the ribbon is farther from the knot's curve
constexpr float kReliefReach = 0.06f;  // farther from a surface than this, its relief is left out

struct Vec2f {
  float x, y;
};

float length2(float x, float y) { return std::sqrt(x * x + y * y); }

float smoothstep(float lo, float hi, float x) {
  const float t = std::clamp((x - lo) / (hi - lo), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

/// Union with a fillet of about `k`.
float smooth_min(float a, float b, float k) {
  const float h = std::max(k - std::abs(a - b), 0.0f) / k;
  return std::min(a, b) - h * h * k * 0.25f;
}

float rounded_box(float x, float y, float half_x, float half_y, float radius) {
  const float qx = std::abs(x) - half_x + radius, qy = std::abs(y) - half_y + radius;
  return length2(std::max(qx, 0.0f), std::max(qy, 0.0f)) + std::min(std::max(qx, qy), 0.0f) - radius;
}

float segment_distance(Vec2f p, Vec2f a, Vec2f b) {
  const float dx = b.x - a.x, dy = b.y - a.y;
  const float s = std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / (dx * dx + dy * dy), 0.0f, 1.0f);
  return length2(p.x - a.x - s * dx, p.y - a.y - s * dy);
}

std::uint32_t mix(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  return x ^ (x >> 16);
}

/// Distance to the strokes of one of many glyphs; p in [-1, 1] squared.
float glyph_distance(Vec2f p, std::uint32_t which) {
  const std::uint32_t bits = mix(which * 2654435761u + 17u);
  float d = 1e3f;
  if (bits & 1u) d = std::min(d, segment_distance(p, {-0.6f, -0.8f}, {-0.6f, 0.8f}));
  if (bits & 2u) d = std::min(d, segment_distance(p, {0.6f, -0.8f}, {0.6f, 0.8f}));
  if (bits & 4u) d = std::min(d, std::abs(length2(p.x, p.y - 0.35f) - 0.4f));
  if (bits & 8u) d = std::min(d, segment_distance(p, {-0.6f, 0.0f}, {0.6f, -0.8f}));
  if (bits & 16u) d = std::min(d, segment_distance(p, {-0.6f, 0.8f}, {0.6f, 0.8f}));
  if (bits & 32u) d = std::min(d, segment_distance(p, {0.0f, -0.8f}, {0.0f, 0.1f}));
  if (bits & 64u) d = std::min(d, length2(p.x, p.y + 0.45f) - 0.12f);
  if ((bits & 127u) == 0 || d > 1e2f) d = std::abs(length2(p.x, p.y) - 0.55f);
  return d;
}

/// How deep a band of glyphs is cut at (u, v): u counts glyphs along the band, v is in [-1, 1] across it.
float glyph_band(float u, float v, std::uint32_t band) {
  const float cell = std::floor(u);
  if (std::abs(v) > 1.3f) return 0;
  const Vec2f p{((u - cell) * 2 - 1) * 1.3f, v};
  return 1 -
         smoothstep(0.06f, 0.19f, glyph_distance(p, band * 977u + static_cast<std::uint32_t>(cell + 512)));
}

/// A groove of half-width `width` about x = 0.
float groove(float x, float width) { return 1 - smoothstep(0.35f * width, width, std::abs(x)); }

Vec3f mix_color(Vec3f a, Vec3f b, float t) { return a * (1 - t) + b * t; }

Vec3f knot_point(float t) {
  const float ring = kKnotMajor + kKnotMinor * std::cos(3 * t);
  return {ring * std::cos(2 * t + kPi / 2), ring * std::sin(2 * t + kPi / 2), kKnotMinor * std::sin(3 * t)};
}

}  // namespace

DemoShape::DemoShape() {
  bounds_.add(Vec3f{-1.95f, -1.66f, -1.0f});
  bounds_.add(Vec3f{1.95f, 1.95f, 1.0f});
  curve_.resize(kCurveSamples);
  const float step = 2 * kPi / kCurveSamples;
  for (int i = 0; i < kCurveSamples; ++i) {
    const float t = step * static_cast<float>(i), e = 1e-2f;
    const Vec3f position = knot_point(t);
    const Vec3f tangent = (knot_point(t + e) - knot_point(t - e)) * (step / (2 * e));
    const float ring = length2(position.x, position.y);
    const Vec3f core{position.x / ring * kKnotMajor, position.y / ring * kKnotMajor, 0};
    const Vec3f unit = normalized(tangent);
    Vec3f out = normalized(position - core);
    out = normalized(out - unit * dot(out, unit));
    const Vec3f across = cross(unit, out);
    // One turn along the knot, uneven, so that the ribbon shows its face here and its edge there.
    const float twist = t + 0.45f * std::sin(3 * t + 0.6f) + 0.5f;
    curve_[static_cast<std::size_t>(i)] = {
        position, tangent, across * std::cos(twist) + out * std::sin(twist),
        out * std::cos(twist) - across * std::sin(twist), dot(tangent, tangent)};
  }
  // The strands near each cell: local minima of the distance.
  strands_.resize(static_cast<std::size_t>(kCells) * kCells * kCells);
  const auto at = [&](int i) -> const CurvePoint& {
    return curve_[static_cast<std::size_t>((i + kCurveSamples) % kCurveSamples)];
  };
  for (std::size_t index = 0; index < strands_.size(); ++index) {
    const Vec3f center = cell_center(index % kCells, index / kCells % kCells, index / kCells / kCells);
    const auto far = [&](int i) { return length(at(i).position - center); };
    std::vector<Strand> minima;
    constexpr int kStride = 16;
    for (int i = 0; i < kCurveSamples; i += kStride)
      if (far(i) <= far(i - kStride) && far(i) < far(i + kStride)) minima.push_back({far(i), i});
    std::sort(minima.begin(), minima.end(), [](Strand a, Strand b) { return a.distance < b.distance; });
    minima.resize(4, {0, -1});
    std::copy(minima.begin(), minima.end(), strands_[index].begin());
  }
}

Vec3f DemoShape::cell_center(std::size_t x, std::size_t y, std::size_t z) const {
  const Vec3f cell = bounds_.extent() * (1.0f / kCells);
  return bounds_.lo + Vec3f{(static_cast<float>(x) + 0.5f) * cell.x, (static_cast<float>(y) + 0.5f) * cell.y,
                            (static_cast<float>(z) + 0.5f) * cell.z};
}

DemoShape::Part DemoShape::ribbon_near(Vec3f p, int start) const {
  // Newton steps to the nearest curve point, in samples; the table's frames are interpolated there.
  float s = static_cast<float>(start);
  for (int k = 0; k < 4; ++k) {
    const int i = static_cast<int>(std::floor(s + 0.5f));
    const CurvePoint& c = curve_[static_cast<std::size_t>((i + 2 * kCurveSamples) % kCurveSamples)];
    const CurvePoint& next = curve_[static_cast<std::size_t>((i + 1 + 2 * kCurveSamples) % kCurveSamples)];
    const Vec3f offset = p - c.position;
    const float slope = c.tangent_squared - dot(offset, next.tangent - c.tangent);
    const float move = dot(offset, c.tangent) / std::max(slope, 0.35f * c.tangent_squared);
    s = static_cast<float>(i) + std::clamp(move, -120.0f, 120.0f);
    if (std::abs(move) < 1) break;
  }
  const float floor_s = std::floor(s), f = s - floor_s;
  const int i = static_cast<int>(floor_s) + 2 * kCurveSamples;
  const CurvePoint& a = curve_[static_cast<std::size_t>(i % kCurveSamples)];
  const CurvePoint& b = curve_[static_cast<std::size_t>((i + 1) % kCurveSamples)];
  const Vec3f offset = p - (a.position * (1 - f) + b.position * f);
  const float v = dot(offset, a.across * (1 - f) + b.across * f);
  const float w = dot(offset, a.out * (1 - f) + b.out * f);
  const float left_over =  // not 0 where Newton stopped short
      dot(offset, a.tangent * (1 - f) + b.tangent * f) / std::sqrt(a.tangent_squared);
  if (v * v + w * w > 0.25f) return {length(offset) - kRibbonReach, 0, 0};

  const float turn = static_cast<float>(i % kCurveSamples) / kCurveSamples + f / kCurveSamples;
  const float t = 2 * kPi * turn;
  const float half_width = 0.275f + 0.022f * std::cos(24 * t);  // scalloped edges
  const float pleat = 0.5f + 0.5f * std::sin(5 * t);
  const float folded =
      w - 0.036f * pleat * std::sin(19 * v + 2.2f * std::sin(4 * t)) - 0.030f * (1 - pleat) * std::cos(9 * v);
  const float half_thickness = 0.082f + 0.018f * smoothstep(0.6f * half_width, half_width, std::abs(v));
  float d = rounded_box(v, folded, half_width, half_thickness, 0.06f) * 0.86f;
  if (std::abs(d) > kReliefReach) return {length2(std::max(d, 0.0f), left_over) + std::min(d, 0.0f), 0, turn};
  const float rim = groove(std::abs(v) - 0.78f * half_width, 0.022f);
  const float glyphs =
      (1 - smoothstep(0.55f, 0.8f, pleat)) * glyph_band(turn * 44, v / 0.125f, folded > 0 ? 1u : 2u);
  const float chevrons =
      smoothstep(0.6f, 0.85f, pleat) *
      (1 - smoothstep(0.25f, 0.5f, std::abs(std::remainder(turn * 88 + std::abs(v) * 7, 1.0f)) * 2)) *
      (1 - smoothstep(0.1f, 0.2f, std::abs(v)));
  const float carved = std::max({rim, glyphs, chevrons * 0.6f});
  d += 0.02f * carved;
  return {length2(std::max(d, 0.0f), left_over) + std::min(d, 0.0f), carved, turn};
}

DemoShape::Part DemoShape::ribbon(Vec3f p) const {
  const Vec3f extent = bounds_.extent(), from = p - bounds_.lo;
  const auto cell = [](float x, float size) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(x / size * kCells), 0, kCells - 1));
  };
  const std::size_t x = cell(from.x, extent.x), y = cell(from.y, extent.y), z = cell(from.z, extent.z);
  const float off_center = length(p - cell_center(x, y, z));
  Part best{1e3f, 0, 0};
  for (const Strand& strand : strands_[(z * kCells + y) * kCells + x]) {
    if (strand.sample < 0) break;
    const float at_least = strand.distance - off_center - kRibbonReach - 0.03f;
    if (at_least > best.distance) break;
    if (at_least > 0.2f) return {std::min(at_least, best.distance), 0, 0};
    const Part part = ribbon_near(p, strand.sample);
    if (part.distance < best.distance) best = part;
  }
  return best;
}

DemoShape::Part DemoShape::plinth(Vec3f p) {
  // A stadium: everything within a radius of a segment along X, in two steps with a frieze round the upper
  // one.
  const float half_length = 0.78f;
  const float x = std::clamp(p.x, -half_length, half_length);
  const float reach = length2(p.x - x, p.z);
  const float y = p.y - kPlinthTop;
  const float upper_radius = 0.66f, lower_radius = 0.78f;
  const float around = rounded_box(reach, y + 0.24f, lower_radius, 0.24f, 0);
  if (around > kReliefReach) return {around, 0, 0};
  const float angle = std::atan2(p.z, p.x - x);
  // Along the upper wall: the front from right to left, the left end, the back, the right end.
  const float straight = 2 * half_length, bend = kPi * upper_radius;
  float arc = straight + bend + half_length + p.x;
  if (p.x > half_length)
    arc = 2 * straight + bend + upper_radius * (angle + kPi / 2);
  else if (p.x < -half_length)
    arc = straight + upper_radius * (angle > 0 ? angle - kPi / 2 : angle + 1.5f * kPi);
  else if (p.z > 0)
    arc = half_length - p.x;
  const float glyph_width = (2 * straight + 2 * bend) / 35;
  float upper = rounded_box(reach, y + 0.17f, upper_radius, 0.17f, 0.03f);
  const float frieze = glyph_band(arc / glyph_width, (y + 0.17f) / 0.085f, 3u) *
                       smoothstep(upper_radius - 0.08f, upper_radius - 0.04f, reach);
  const float lines = groove(std::abs(y + 0.17f) - 0.125f, 0.016f) *
                      smoothstep(upper_radius - 0.08f, upper_radius - 0.04f, reach);
  const float rings = smoothstep(-0.06f, -0.03f, y) * groove(std::remainder(reach, 0.13f), 0.02f);
  const float carved = std::max({frieze, lines, rings * 0.7f});
  upper += 0.02f * carved;
  const float flutes = 0.012f * (1 - std::abs(std::sin(arc * 14))) *
                       smoothstep(lower_radius - 0.06f, lower_radius - 0.02f, reach);
  const float lower = rounded_box(reach, y + 0.40f, lower_radius, 0.08f, 0.03f) + flutes;
  return {std::min(upper, lower) * 0.92f, carved, 0.5f};
}

DemoShape::Part DemoShape::cup(Vec3f p) {
  // A hollow sphere open towards the viewer's upper right, its lip curled inwards.
  const Vec3f axis = normalized(Vec3f{0.25f, 0.55f, 0.8f});
  const Vec3f q = p - kCupCenter;
  if (length(q) > 0.6f) return {length(q) - 0.5f, 0, 0};
  const float up = dot(q, axis);
  const Vec3f aside = q - axis * up;
  const float out = length(aside), radius = 0.43f, r = length(q);
  const Vec3f side = normalized(cross(axis, Vec3f{0, 1, 0}));
  const float angle = std::atan2(dot(aside, side), dot(aside, cross(axis, side)));
  const float latitude = std::atan2(up, out);
  const float spiral = angle * 9 + latitude * 5;
  const float carved = groove(std::remainder(spiral, 2 * kPi), 0.9f) * smoothstep(1.05f, 0.8f, latitude) *
                       (r > radius - 0.02f ? 1.0f : 0.0f);
  const float shell = std::abs(r - radius + 0.04f) - 0.04f + 0.018f * carved;
  const float mouth = 1.02f;  // the lip's latitude in radians
  const float open = (latitude - mouth) * r;
  const float lip_x = out - (radius - 0.05f) * std::cos(mouth),
              lip_y = up - (radius - 0.05f) * std::sin(mouth);
  const float lip = length2(lip_x, lip_y) - 0.058f;
  return {smooth_min(std::max(shell, open), lip, 0.03f), carved, latitude};
}

ShapeSample DemoShape::sample(Vec3f p) const {
  const Part knot = ribbon(p), base = plinth(p), bowl = cup(p);
  const float d = smooth_min(smooth_min(knot.distance, base.distance, 0.05f), bowl.distance, 0.03f);

  const Vec3f knot_color = mix_color({0.66f, 0.52f, 0.36f}, {0.30f, 0.53f, 0.55f},
                                     0.5f + 0.5f * std::sin(2 * kPi * 3 * knot.along));
  const Vec3f knot_cut{0.20f, 0.17f, 0.15f}, base_color{0.74f, 0.71f, 0.66f}, base_cut{0.42f, 0.37f, 0.33f};
  const Vec3f bowl_color{0.86f, 0.80f, 0.69f}, bowl_cut{0.62f, 0.33f, 0.22f};
  const Vec3f of_knot = mix_color(knot_color, knot_cut, 0.8f * knot.carved);
  const Vec3f of_base = mix_color(base_color, base_cut, 0.8f * base.carved);
  const Vec3f of_bowl = mix_color(bowl_color, bowl_cut, 0.9f * bowl.carved);
  const bool is_bowl = bowl.distance < std::min(knot.distance, base.distance);
  return {d, is_bowl ? of_bowl : knot.distance < base.distance ? of_knot : of_base};
}

Vec3f DemoShape::normal(Vec3f p, float step) const {
  const Vec3f a{step, -step, -step}, b{-step, -step, step}, c{-step, step, -step}, d{step, step, step};
  return normalized(a * distance(p + a) + b * distance(p + b) + c * distance(p + c) + d * distance(p + d));
}

}  // namespace rbvh::demo
