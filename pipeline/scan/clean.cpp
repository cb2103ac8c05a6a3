#include "pipeline/scan/clean.h"

#include <bit>
#include <cstring>

#include "pipeline/base/error.h"
#include "pipeline/scan/compact.h"

namespace rbvh {
namespace {

/// For each of `count` elements the first that is equal. A hash table with linear probing, at most half full.
template <class Hash, class Equal>
std::vector<std::uint32_t> first_equal(std::size_t count, Hash hash, Equal equal) {
  constexpr std::uint32_t kEmpty = UINT32_MAX;
  std::vector<std::uint32_t> first(count);
  std::vector<std::uint32_t> slots(std::bit_ceil(2 * count + 1), kEmpty);
  for (std::uint32_t i = 0; i < count; ++i) {
    std::size_t at = hash(i) & (slots.size() - 1);
    while (slots[at] != kEmpty && !equal(slots[at], i)) at = (at + 1) & (slots.size() - 1);
    if (slots[at] == kEmpty) slots[at] = i;
    first[i] = slots[at];
  }
  return first;
}

std::uint64_t mix(std::uint64_t hash, std::uint64_t value) {
  hash = (hash ^ value) * 0x9e3779b97f4a7c15u;
  return hash ^ (hash >> 29);
}

std::uint64_t bits(float value) { return std::bit_cast<std::uint32_t>(value + 0.0f); }

template <class T>
bool same_bits(const std::vector<T>& values, std::uint32_t a, std::uint32_t b) {
  // -0 and 0 differ, NaN equals itself: as mix_bytes() hashes them.
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
  return values.empty() || std::memcmp(&values[a], &values[b], sizeof(T)) == 0;
}

template <class T>
std::uint64_t mix_bytes(std::uint64_t hash, const std::vector<T>& values, std::uint32_t i) {
  if (values.empty()) return hash;
  std::uint64_t words[(sizeof(T) + 7) / 8] = {};
  std::memcpy(words, &values[i], sizeof(T));
  for (const std::uint64_t word : words) hash = mix(hash, word);
  return hash;
}

std::uint64_t mix_attributes(std::uint64_t hash, const Scan& scan, std::uint32_t i) {
  hash = mix_bytes(hash, scan.normals, i);
  hash = mix_bytes(hash, scan.radii, i);
  hash = mix_bytes(hash, scan.colors, i);
  if (scan.is_cloud()) hash = mix_bytes(hash, scan.object_ids, i);
  for (const ScalarProperty& property : scan.properties) hash = mix_bytes(hash, property.values, i);
  return hash;
}

bool same_attributes(const Scan& scan, std::uint32_t a, std::uint32_t b) {
  if (!same_bits(scan.normals, a, b) || !same_bits(scan.radii, a, b) || !same_bits(scan.colors, a, b))
    return false;
  if (scan.is_cloud() && !same_bits(scan.object_ids, a, b)) return false;
  for (const ScalarProperty& property : scan.properties)
    if (!same_bits(property.values, a, b)) return false;
  return true;
}

/// The corners rotated so that the smallest index comes first.
Triangle rotated(Triangle t) {
  if (t[0] <= t[1] && t[0] <= t[2]) return t;
  return t[1] <= t[2] ? Triangle{t[1], t[2], t[0]} : Triangle{t[2], t[0], t[1]};
}

/// Exact unless the coordinates' exponents are 29 bits apart: differences of floats and their products fit a
/// double.
bool has_area(const Scan& scan, Triangle t) {
  const Vec3d a = static_cast<Vec3d>(scan.positions[t[0]]);
  const Vec3d n =
      cross(static_cast<Vec3d>(scan.positions[t[1]]) - a, static_cast<Vec3d>(scan.positions[t[2]]) - a);
  return n != Vec3d{};
}

void drop_non_finite(Scan& scan, CleanCounts& counts) {
  std::vector<std::uint8_t> keep(scan.positions.size());
  for (std::size_t i = 0; i < keep.size(); ++i) {
    keep[i] = is_finite(scan.positions[i]);
    counts.non_finite_vertices += !keep[i];
  }
  if (counts.non_finite_vertices > 0) counts.non_finite_faces = keep_vertices(scan, keep);
}

void drop_duplicate_vertices(Scan& scan, CleanCounts& counts) {
  const std::vector<std::uint32_t> first = first_equal_vertices(scan, true);
  std::vector<std::uint8_t> keep(first.size());
  for (std::uint32_t i = 0; i < first.size(); ++i) {
    keep[i] = first[i] == i;
    counts.duplicate_vertices += !keep[i];
  }
  if (counts.duplicate_vertices == 0) return;
  for (Triangle& triangle : scan.triangles)
    for (std::uint32_t& corner : triangle) corner = first[corner];
  keep_vertices(scan, keep);
}

void drop_faces(Scan& scan, CleanCounts& counts) {
  std::vector<std::uint8_t> keep(scan.triangles.size());
  for (std::size_t i = 0; i < keep.size(); ++i) {
    keep[i] = has_area(scan, scan.triangles[i]);
    counts.zero_area_faces += !keep[i];
  }
  if (counts.zero_area_faces > 0) keep_triangles(scan, keep);

  const auto id = [&](std::uint32_t i) { return scan.object_ids.empty() ? 0 : scan.object_ids[i]; };
  const std::vector<std::uint32_t> first = first_equal(
      scan.triangles.size(),
      [&](std::uint32_t i) {
        const Triangle t = rotated(scan.triangles[i]);
        return mix(mix(mix(t[0], t[1]), t[2]), static_cast<std::uint64_t>(id(i)));
      },
      [&](std::uint32_t a, std::uint32_t b) {
        return rotated(scan.triangles[a]) == rotated(scan.triangles[b]) && id(a) == id(b);
      });
  keep.resize(first.size());
  for (std::uint32_t i = 0; i < first.size(); ++i) {
    keep[i] = first[i] == i;
    counts.duplicate_faces += !keep[i];
  }
  if (counts.duplicate_faces > 0) keep_triangles(scan, keep);
}

void drop_coincident(Scan& scan, CleanCounts& counts) {
  const std::vector<std::uint32_t> first = first_equal_vertices(scan, false);
  std::vector<Triangle> triangles = scan.triangles;
  for (Triangle& t : triangles)
    for (std::uint32_t& corner : t) corner = first[corner];
  const std::vector<FaceFate> fates = settle_coincident(
      triangles, scan.positions, scan.object_ids, kLargestFlap * bounds(scan).diagonal(), counts.coincident);
  if (fates.empty()) return;
  std::vector<std::uint8_t> keep(fates.size());
  for (std::size_t i = 0; i < fates.size(); ++i)
    keep[i] = fates[i] == FaceFate::kStays || fates[i] == FaceFate::kSheet;
  keep_triangles(scan, keep);
}

void drop_unreferenced(Scan& scan, CleanCounts& counts) {
  std::vector<std::uint8_t> keep(scan.positions.size());
  for (const Triangle& triangle : scan.triangles)
    for (const std::uint32_t corner : triangle) keep[corner] = 1;
  for (const std::uint8_t kept : keep) counts.unreferenced_vertices += !kept;
  if (counts.unreferenced_vertices > 0) keep_vertices(scan, keep);
}

}  // namespace

std::vector<std::uint32_t> first_equal_vertices(const Scan& scan, bool attributes) {
  RBVH_CHECK(scan.positions.size() < UINT32_MAX);
  return first_equal(
      scan.positions.size(),
      [&](std::uint32_t i) {
        const Vec3f p = scan.positions[i];
        const std::uint64_t hash = mix(mix(mix(0, bits(p.x)), bits(p.y)), bits(p.z));
        return attributes ? mix_attributes(hash, scan, i) : hash;
      },
      [&](std::uint32_t a, std::uint32_t b) {
        return scan.positions[a] == scan.positions[b] && (!attributes || same_attributes(scan, a, b));
      });
}

CleanCounts clean(Scan& scan) {
  const bool is_mesh = !scan.is_cloud();
  CleanCounts counts;
  drop_non_finite(scan, counts);
  // A mesh that has lost all its faces must not go on as a cloud of its vertices.
  if (is_mesh && scan.triangles.empty()) return counts;
  drop_duplicate_vertices(scan, counts);
  if (!is_mesh) return counts;
  drop_faces(scan, counts);
  drop_coincident(scan, counts);
  drop_unreferenced(scan, counts);
  return counts;
}

}  // namespace rbvh
