#include "pipeline/rbvh/snap_primitives.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <utility>

#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/coincident.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
constexpr std::uint32_t kNone = 0xffffffffu;
/// The cosine between normals of vertices that are one, and, of 255, the difference between their colours.
constexpr float kAlikeNormal = 0.99f;
constexpr int kSameColor = 32;

std::uint64_t hash_of(Vec3f p) {
  std::uint64_t hash = 0;
  for (int axis = 0; axis < 3; ++axis)
    hash = (hash ^ std::bit_cast<std::uint32_t>(p[axis] + 0.0f)) * 0x9e3779b97f4a7c15u;
  return hash ^ (hash >> 29);
}

/// A hash table with linear probing, at most half full.
std::vector<std::uint32_t> first_at_place(const RefinedLevel& level, const Scan& scan,
                                          const Lattice& lattice) {
  std::vector<std::uint32_t> first(scan.positions.size(), kNone), vertices;
  for (const std::vector<std::uint32_t>& held : level.held)
    for (const std::uint32_t i : held)
      for (const std::uint32_t v : scan.triangles[i])
        if (first[v] == kNone) {
          first[v] = v;
          vertices.push_back(v);
        }
  std::vector<Vec3f> places(vertices.size());
  parallel_for(vertices.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) places[k] = snapped(lattice, scan.positions[vertices[k]]);
  });
  std::vector<std::uint32_t> slots(std::bit_ceil(2 * vertices.size() + 1), kNone);
  for (std::uint32_t k = 0; k < vertices.size(); ++k) {
    std::size_t at = hash_of(places[k]) & (slots.size() - 1);
    while (slots[at] != kNone && places[slots[at]] != places[k]) at = (at + 1) & (slots.size() - 1);
    if (slots[at] == kNone) slots[at] = k;
    first[vertices[k]] = vertices[slots[at]];
  }
  return first;
}

}  // namespace

PrimitiveVertices::PrimitiveVertices(const Scan& scan, std::span<const Vec3f> normals, const Lattice& lattice,
                                     std::span<const std::uint32_t> first_at_place, Scan& to)
    : scan_(scan),
      normals_(normals),
      lattice_(lattice),
      first_at_place_(first_at_place),
      to_(to),
      numbers_(scan.positions.size(), kNone),
      last_at_place_(first_at_place.size(), kNone) {}

bool PrimitiveVertices::are_alike(std::uint32_t number, Vec3f normal, std::uint32_t vertex) const {
  // Normals of the scan's own tell edges from the rest; those that follow from its faces only tell sides.
  if (dot(to_.normals[number], normal) < (scan_.normals.empty() ? 0 : kAlikeNormal)) return false;
  if (scan_.colors.empty()) return true;
  const Color8 &a = to_.colors[number], &b = scan_.colors[vertex];
  for (std::size_t c = 0; c < 3; ++c)
    if (std::abs(int{a[c]} - int{b[c]}) > kSameColor) return false;
  return true;
}

std::uint32_t PrimitiveVertices::add(std::uint32_t vertex) {
  std::uint32_t& number = numbers_[vertex];
  if (number != kNone) return number;
  const auto unit = static_cast<Vec3f>(normalized(static_cast<Vec3d>(normals_[vertex])));
  const Vec3f normal = lattice_.step > 0 ? unpack_normal(pack_normal(unit)) : unit;
  number = static_cast<std::uint32_t>(to_.positions.size());
  if (!scan_.is_cloud()) {
    std::uint32_t& last = last_at_place_[first_at_place_[vertex]];
    for (std::uint32_t other = last; other != kNone; other = before_[other])
      if (are_alike(other, normal, vertex)) return number = other;
    before_.push_back(std::exchange(last, number));
  }
  to_.positions.push_back(snapped(lattice_, scan_.positions[vertex]));
  to_.normals.push_back(normal);
  if (!scan_.colors.empty()) to_.colors.push_back(scan_.colors[vertex]);
  return number;
}

std::vector<std::uint32_t> drop_collapsed(RefinedLevel& level, const Scan& scan, const Lattice& lattice) {
  if (scan.is_cloud()) return {};
  std::vector<std::uint32_t> first = first_at_place(level, scan, lattice);
  if (!(lattice.step > 0)) return first;  // nothing was rounded: the scan's triangles stay as they are
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> numbers;  // in the scan
  std::vector<std::int32_t> objects;
  std::vector<std::uint8_t> stays(scan.triangles.size(), 0);
  for (const std::vector<std::uint32_t>& held : level.held)
    for (const std::uint32_t i : held) {
      const Triangle &t = scan.triangles[i], placed{first[t[0]], first[t[1]], first[t[2]]};
      if (placed[0] == placed[1] || placed[1] == placed[2] || placed[2] == placed[0]) continue;
      stays[i] = 1;
      triangles.push_back(placed);
      numbers.push_back(i);
      if (!scan.object_ids.empty()) objects.push_back(scan.object_ids[i]);
    }
  CoincidentCounts counts;
  const std::vector<FaceFate> fates =
      settle_coincident(triangles, scan.positions, objects, kLargestFold * bounds(scan).diagonal(), counts);
  for (std::size_t k = 0; k < fates.size(); ++k)
    if (fates[k] == FaceFate::kGoes || fates[k] == FaceFate::kSheetsBack) stays[numbers[k]] = 0;
  std::size_t left = 0;
  for (std::size_t k = 0; k < level.tiles.size(); ++k) {
    const bool holds = level.tiles[k].decision == LeafDecision::kPrimitives;
    std::vector<std::uint32_t>& held = level.held[k];
    const std::vector<std::uint32_t> last(held.end() - (held.empty() ? 0 : 1), held.end());
    std::erase_if(held, [&](std::uint32_t i) { return stays[i] == 0; });
    if (holds && held.empty()) {
      if (left > 0 || k + 1 < level.tiles.size()) continue;
      held = last;
    }
    if (left != k) {
      level.tiles[left] = std::move(level.tiles[k]);
      level.held[left] = std::move(held);
    }
    ++left;
  }
  level.tiles.resize(left);
  level.held.resize(left);
  return first;
}

}  // namespace rbvh
