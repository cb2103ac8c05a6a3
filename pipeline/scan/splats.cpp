#include "pipeline/scan/splats.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/error.h"
#include "pipeline/base/text.h"
#include "pipeline/scan/compact.h"

namespace rbvh {
namespace {

constexpr double kLeastOpacity = 0.5;
constexpr double kDeviations = 1.5;
constexpr double kSphericalHarmonic = 0.28209479177387814;  // of degree 0: 1 / (2 sqrt(pi))

const std::vector<float>* find(const RawScan& cloud, const std::string& name) {
  for (const ScalarProperty& property : cloud.properties)
    if (property.name == name) return &property.values;
  return nullptr;
}

template <std::size_t N>
std::array<const std::vector<float>*, N> find_all(const RawScan& cloud, const std::string& stem) {
  std::array<const std::vector<float>*, N> found{};
  for (std::size_t i = 0; i < N; ++i) found[i] = find(cloud, stem + std::to_string(i));
  return found;
}

template <std::size_t N>
bool has_all(const RawScan& cloud, const std::string& stem) {
  const auto found = find_all<N>(cloud, stem);
  return std::all_of(found.begin(), found.end(), [](const auto* values) { return values != nullptr; });
}

bool is_of_splats(const std::string& name) {
  return name == "opacity" || name.starts_with("f_dc_") || name.starts_with("f_rest_") ||
         name.starts_with("scale_") || name.starts_with("rot_");
}

/// Where the rotation by the quaternion w, x, y, z takes an axis.
Vec3d turned_axis(std::array<double, 4> q, int axis) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& part : q) part /= norm;
  const auto [w, x, y, z] = q;
  if (axis == 0) return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
  if (axis == 1) return {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
  return {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

std::uint8_t color_byte(float harmonic) {
  const double value = 0.5 + kSphericalHarmonic * static_cast<double>(harmonic);
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
}

}  // namespace

bool is_splats(const RawScan& cloud) {
  return cloud.triangles.empty() && find(cloud, "opacity") != nullptr && has_all<3>(cloud, "f_dc_") &&
         has_all<3>(cloud, "scale_") && has_all<4>(cloud, "rot_");
}

void splats_to_discs(RawScan& cloud, const std::string& file) {
  const std::size_t count = cloud.positions.size();
  const std::vector<float>& opacity = *find(cloud, "opacity");
  const auto color = find_all<3>(cloud, "f_dc_"), scale = find_all<3>(cloud, "scale_");
  const auto turn = find_all<4>(cloud, "rot_");
  Bounds3d box;
  for (const Vec3d& p : cloud.positions)
    if (is_finite(p)) box.add(p);
  const Vec3d middle = box.center();
  cloud.normals.assign(count, {});
  cloud.radii.assign(count, 0);
  cloud.colors.assign(count, {});
  std::vector<std::uint8_t> keep(count);
  std::size_t kept = 0, faint = 0;
  for (std::size_t i = 0; i < count; ++i) {
    // Opacities are logits, scales logarithms of deviations.
    const bool is_faint = !(1 / (1 + std::exp(-static_cast<double>(opacity[i]))) > kLeastOpacity);
    std::array<double, 3> size{};
    for (std::size_t k = 0; k < 3; ++k) size[k] = std::exp(static_cast<double>((*scale[k])[i]));
    std::array<double, 4> q{};
    for (std::size_t k = 0; k < 4; ++k) q[k] = static_cast<double>((*turn[k])[i]);
    const auto shortest = static_cast<int>(std::min_element(size.begin(), size.end()) - size.begin());
    Vec3d normal = turned_axis(q, shortest);
    std::sort(size.begin(), size.end());
    const double radius = kDeviations * std::sqrt(size[1] * size[2]);
    faint += is_faint;
    if (is_faint || !std::isfinite(length(normal)) || !(radius > 0) || !std::isfinite(radius)) continue;
    if (dot(normal, cloud.positions[i] - middle) < 0) normal = normal * -1.0;
    cloud.normals[i] = Vec3f(normal);
    cloud.radii[i] = static_cast<float>(radius);
    for (std::size_t k = 0; k < 3; ++k) cloud.colors[i][k] = color_byte((*color[k])[i]);
    keep[i] = 1;
    ++kept;
  }
  if (kept == 0) throw Error(ErrorKind::kInput, file, "has Gaussian splats, all of them below half opacity");
  std::erase_if(cloud.properties, [](const ScalarProperty& p) { return is_of_splats(p.name); });
  keep_vertex_entries(cloud, keep);
  if (!cloud.object_ids.empty()) keep_entries(cloud.object_ids, keep);
  std::string note = "Gaussian splats become discs; " + std::to_string(faint) + " of " +
                     std::to_string(count) + " are below half opacity, and are left out";
  if (const std::size_t broken = count - kept - faint; broken > 0)
    note += "; " + counted(broken, "splat") + " without a size or a direction, too";
  cloud.notes.push_back(note);
}

}  // namespace rbvh
