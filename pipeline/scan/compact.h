// Removes elements from all arrays of a scan.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh {

/// Keeps the vertices with a non-zero `keep`, in their order. Triangles that lose a corner are removed
/// too; returns their number.
std::size_t keep_vertices(Scan& scan, std::span<const std::uint8_t> keep);

/// Keeps the triangles with a non-zero `keep`, in their order.
void keep_triangles(Scan& scan, std::span<const std::uint8_t> keep);

/// Keeps the entries of `values` with a non-zero `keep`; an empty array stays empty.
template <class T>
void keep_entries(std::vector<T>& values, std::span<const std::uint8_t> keep) {
  std::size_t to = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (keep[i]) values[to++] = values[i];
  values.resize(to);
}

/// Keeps what belongs to the vertices with a non-zero `keep`; triangles stay as they are.
template <class AnyScan>
void keep_vertex_entries(AnyScan& scan, std::span<const std::uint8_t> keep) {
  keep_entries(scan.positions, keep);
  keep_entries(scan.normals, keep);
  keep_entries(scan.radii, keep);
  keep_entries(scan.colors, keep);
  for (ScalarProperty& property : scan.properties) keep_entries(property.values, keep);
}

}  // namespace rbvh
