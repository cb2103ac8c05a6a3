#include "pipeline/light/material.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/vector_math.h"
#include "pipeline/light/environment.h"

namespace rbvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kSmoothest = 1e-3f;  // alpha; below it GGX's peak leaves floats

Vec3f gray(float value) { return {value, value, value}; }
Vec3f mirrored(Vec3f d, Vec3f n) { return n * (2 * dot(d, n)) - d; }

float alpha_of(const Material& material) {
  return std::max(kSmoothest, material.roughness * material.roughness);
}

// Unpolarised, from outside; `cos` of the incoming direction.
float fresnel(float cos, float ior) {
  const float sin2 = (1 - cos * cos) / (ior * ior);
  if (sin2 >= 1) return 1;
  const float through = std::sqrt(1 - sin2);
  const float s = (cos - ior * through) / (cos + ior * through),
              p = (ior * cos - through) / (ior * cos + through);
  return 0.5f * (s * s + p * p);
}

Vec3f schlick(Vec3f f0, float cos) {
  const float away = 1 - cos, m = away * away * away * away * away;
  return f0 + (gray(1) - f0) * m;
}

// --- the matte lobe
// ----------------------------------------------------------------------------------------- A cosine lobe
// about the shading normal. What of it lies below the geometric surface is mirrored up, so that a smooth
// normal neither loses nor makes light.

float matte_density(const ShadingPoint& at, Vec3f d) {
  const float height = dot(d, at.geometric);
  if (!(height > 0)) return 0;
  const Vec3f below = d - at.geometric * (2 * height);
  return (std::max(0.f, dot(d, at.normal)) + std::max(0.f, dot(below, at.normal))) / kPi;
}

Vec3f sample_matte(const ShadingPoint& at, float u, float v) {
  Vec3f x, y;
  make_frame(at.normal, x, y);
  const float r = std::sqrt(u), phi = 2 * kPi * v;
  const Vec3f d = normalized(x * (r * std::cos(phi)) + y * (r * std::sin(phi)) +
                             at.normal * std::sqrt(std::max(0.f, 1 - u)));
  const float height = dot(d, at.geometric);
  return height < 0 ? d - at.geometric * (2 * height) : d;
}

// --- GGX
// ---------------------------------------------------------------------------------------------------- Walter
// et al. 2007; visible normals by Heitz 2018; height-correlated Smith masking.

float ggx(float cos, float alpha) {
  if (!(cos > 0)) return 0;
  const float a2 = alpha * alpha, d = cos * cos * (a2 - 1) + 1;
  return a2 / (kPi * d * d);
}

// Smith's Lambda.
float masking(float cos, float alpha) {
  const float c2 = cos * cos;
  if (!(c2 > 0)) return 1e9f;
  return 0.5f * (std::sqrt(1 + alpha * alpha * (1 - c2) / c2) - 1);
}

Vec3f sample_visible_normal(const ShadingPoint& at, float alpha, float u, float v) {
  Vec3f x, y;
  make_frame(at.normal, x, y);
  const Vec3f view =
      normalized(Vec3f{alpha * dot(at.view, x), alpha * dot(at.view, y), dot(at.view, at.normal)});
  Vec3f t1{1, 0, 0};
  if (const float flat = view.x * view.x + view.y * view.y; flat > 1e-12f)
    t1 = Vec3f{-view.y, view.x, 0} * (1 / std::sqrt(flat));
  const Vec3f t2 = cross(view, t1);
  const float r = std::sqrt(u), phi = 2 * kPi * v, half = 0.5f * (1 + view.z);
  const float p1 = r * std::cos(phi);
  const float p2 = (1 - half) * std::sqrt(std::max(0.f, 1 - p1 * p1)) + half * r * std::sin(phi);
  const Vec3f h = t1 * p1 + t2 * p2 + view * std::sqrt(std::max(0.f, 1 - p1 * p1 - p2 * p2));
  return normalized(x * (alpha * h.x) + y * (alpha * h.y) + at.normal * std::max(1e-6f, h.z));
}

// D G / (4 cos cos) * cos of the light, without Fresnel's term; and the density of that direction.
struct Lobe {
  float value = 0, pdf = 0, half_cos = 0;
};

Lobe ggx_lobe(const ShadingPoint& at, float alpha, Vec3f light) {
  const float cos_light = dot(light, at.normal), cos_view = dot(at.view, at.normal);
  if (!(cos_light > 0 && cos_view > 0 && dot(light, at.geometric) > 0)) return {};
  const Vec3f half = normalized(light + at.view);
  const float d = ggx(dot(half, at.normal), alpha);
  const float view_masking = masking(cos_view, alpha);
  return {d / (4 * cos_view * (1 + view_masking + masking(cos_light, alpha))),
          d / (4 * cos_view * (1 + view_masking)), std::max(0.f, dot(half, at.view))};
}

// --- glass
// --------------------------------------------------------------------------------------------------

ScatterSample sample_glass(const Material& material, const ShadingPoint& at, float choice) {
  const auto through = [&](Vec3f normal, Vec3f& direction) {
    const float eta = at.outside ? 1 / material.ior : material.ior, cos = dot(at.view, normal);
    const float sin2 = eta * eta * (1 - cos * cos);
    if (sin2 >= 1) return false;
    direction = normalized(normal * (eta * cos - std::sqrt(1 - sin2)) - at.view * eta);
    return true;
  };
  Vec3f normal = at.normal, refracted;
  bool passes = through(normal, refracted);
  // A smooth normal that would send light to the wrong side of the surface.
  if (dot(mirrored(at.view, normal), at.geometric) <= 0 || (passes && dot(refracted, at.geometric) >= 0)) {
    normal = at.geometric;
    passes = through(normal, refracted);
  }
  const float cos = std::clamp(dot(at.view, normal), 0.f, 1.f);
  const float reflected = passes ? fresnel(cos, at.outside ? material.ior : 1 / material.ior) : 1;
  ScatterSample s;
  s.is_mirror = true;
  s.pdf = 1;
  s.is_through = choice >= reflected;
  s.direction = s.is_through ? refracted : mirrored(at.view, normal);
  s.weight = s.is_through ? at.albedo : gray(1);
  return s;
}

// --- a matte base under a coat
// ------------------------------------------------------------------------------

// How often the coat is sampled.
float coat_share(const Material& material, const ShadingPoint& at) {
  const float f = fresnel(std::clamp(dot(at.view, at.normal), 0.f, 1.f), material.ior);
  return std::clamp(f / (f + (1 - f) * std::max(0.05f, luminance(at.albedo))), 0.1f, 0.9f);
}

Scattering evaluate_glossy(const Material& material, const ShadingPoint& at, Vec3f light) {
  const float share = coat_share(material, at);
  const Lobe lobe = ggx_lobe(at, alpha_of(material), light);
  const float matte = matte_density(at, light);
  const float in = 1 - fresnel(std::clamp(dot(light, at.normal), 0.f, 1.f), material.ior);
  const float out = 1 - fresnel(std::clamp(dot(at.view, at.normal), 0.f, 1.f), material.ior);
  return {at.albedo * (matte * in * out) + gray(lobe.value * fresnel(lobe.half_cos, material.ior)),
          share * lobe.pdf + (1 - share) * matte};
}

}  // namespace

Scattering evaluate(const Material& material, const ShadingPoint& at, Vec3f to_light) {
  switch (material.kind) {
    case Material::Kind::kMatte: {
      const float density = matte_density(at, to_light);
      return {at.albedo * density, density};
    }
    case Material::Kind::kGlossy:
      return evaluate_glossy(material, at, to_light);
    case Material::Kind::kMetal: {
      const Lobe lobe = ggx_lobe(at, alpha_of(material), to_light);
      return {schlick(at.albedo, lobe.half_cos) * lobe.value, lobe.pdf};
    }
    case Material::Kind::kGlass:
      break;
  }
  return {};
}

ScatterSample sample(const Material& material, const ShadingPoint& at, float choice, float u, float v) {
  if (material.kind == Material::Kind::kGlass) return sample_glass(material, at, choice);
  ScatterSample s;
  if (material.kind == Material::Kind::kMatte) {
    s.direction = sample_matte(at, u, v);
    s.pdf = matte_density(at, s.direction);
    s.weight = at.albedo;
    return s;
  }
  const bool coat = material.kind == Material::Kind::kMetal || choice < coat_share(material, at);
  s.direction =
      coat ? mirrored(at.view, sample_visible_normal(at, alpha_of(material), u, v)) : sample_matte(at, u, v);
  const Scattering scattering = evaluate(material, at, s.direction);
  s.pdf = scattering.pdf;
  if (s.pdf > 0) s.weight = scattering.value * (1 / s.pdf);
  return s;
}

}  // namespace rbvh
