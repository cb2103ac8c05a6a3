#include "pipeline/scan/components.h"

#include "pipeline/base/error.h"
#include "pipeline/base/sets.h"
#include "pipeline/scan/clean.h"
#include "pipeline/scan/compact.h"
#include "pipeline/scan/neighbors.h"

namespace rbvh {
namespace {

constexpr std::size_t kNeighbors = 16;

void connect_faces(const Scan& scan, Sets& sets) {
  const std::vector<std::uint32_t> first = first_equal_vertices(scan, false);
  for (std::uint32_t i = 0; i < first.size(); ++i) sets.join(i, first[i]);
  for (const Triangle& t : scan.triangles) {
    sets.join(t[0], t[1]);
    sets.join(t[0], t[2]);
  }
}

void connect_discs(const Scan& scan, Sets& sets) {
  RBVH_CHECK(scan.radii.size() == scan.positions.size());
  const Neighbors neighbors = find_neighbors(scan.positions, kNeighbors);
  for (std::uint32_t i = 0; i < scan.positions.size(); ++i)
    for (const std::uint32_t j : neighbors.of(i))
      if (length(scan.positions[i] - scan.positions[j]) <= scan.radii[i] + scan.radii[j]) sets.join(i, j);
}

}  // namespace

ComponentCounts remove_small_components(Scan& scan, double fraction) {
  const std::size_t count = scan.positions.size();
  Sets sets(count);
  scan.is_cloud() ? connect_discs(scan, sets) : connect_faces(scan, sets);

  std::vector<std::size_t> size(count, 0);  // at the roots
  if (scan.is_cloud()) {
    for (std::uint32_t i = 0; i < count; ++i) ++size[sets.find(i)];
  } else {
    for (const Triangle& t : scan.triangles) ++size[sets.find(t[0])];
  }
  const double least = fraction * static_cast<double>(scan.is_cloud() ? count : scan.triangles.size());
  ComponentCounts counts;
  std::vector<std::uint8_t> keep(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t root = sets.find(i);
    keep[i] = static_cast<double>(size[root]) >= least;
    counts.vertices += !keep[i];
    counts.components += !keep[i] && root == i;
  }
  if (counts.vertices > 0) counts.faces = keep_vertices(scan, keep);
  return counts;
}

}  // namespace rbvh
