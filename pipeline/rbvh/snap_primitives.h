// What moving a level's primitives to its lattice makes of them: vertices that meet become one, triangles
// without area go, and so do flaps.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/rbvh/refine.h"
#include "rbvh/scan.h"

namespace rbvh {

/// Normals of vertices closer to those of their triangles (cosine of 20 degrees) are not stored.
inline constexpr float kSameNormal = 0.94f;

/// Keeps parts that are thinner than the lattice, such as wires: where rounding would leave no area to all
/// triangles at an edge or in a cell, moves a vertex or two of one of them by a step. `stays`: of each vertex
/// whether it must stay, or empty.
void widen_thin_parts(Scan& scan, const Lattice& lattice, std::span<const std::uint8_t> stays = {});

/// For each vertex of the leaves' triangles the first of them at its place.
std::vector<std::uint32_t> find_first_at_place(const RefinedLevel& level, const Scan& scan,
                                               std::span<const Vec3f> places);

/// Takes triangles out of the leaves that hold these: those that have no area at their places, and those that
/// settle_coincident() takes there, flaps up to kLargestFold of the lattice's steps. Leaves that are left
/// empty go, but for the last.
void drop_collapsed(RefinedLevel& level, const Scan& scan, std::span<const std::uint32_t> first_at_place,
                    const Lattice& lattice);

/// Gathers the vertices that a level's primitives use, numbered by first use. Those of triangles that are at
/// one place on the lattice are one, unless their normals or colours differ: two sides of an edge that the
/// scan has.
class PrimitiveVertices {
 public:
  /// `copies`: of CreasedMesh, with `normals` for these, too. `places`: where the scan's vertices lie on the
  /// lattice. `first_at_place`: of these; of discs none.
  PrimitiveVertices(const Scan& scan, std::span<const Vec3f> normals, std::span<const std::uint32_t> copies,
                    const Lattice& lattice, std::span<const Vec3f> places,
                    std::span<const std::uint32_t> first_at_place, Scan& to);

  /// The number of the scan's vertex, or of a copy.
  std::uint32_t add(std::uint32_t side);

 private:
  bool are_alike(std::uint32_t number, Vec3f normal, std::uint32_t vertex) const;

  const Scan& scan_;
  std::span<const Vec3f> normals_;
  std::span<const std::uint32_t> copies_;
  const Lattice& lattice_;
  std::span<const Vec3f> places_;
  std::span<const std::uint32_t> first_at_place_;
  Scan& to_;
  std::vector<std::uint32_t> numbers_;
  std::vector<std::uint32_t> last_at_place_;  ///< of the scan's vertices that are first there
  std::vector<std::uint32_t> before_;         ///< of each number the one before it at its place
};

}  // namespace rbvh
