#include "pipeline/rbvh/snap_primitives.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "pipeline/base/parallel_for.h"
#include "pipeline/rbvh/leaf_primitives.h"
#include "pipeline/rbvh/texel.h"
#include "pipeline/scan/coincident.h"
#include "pipeline/scan/creases.h"
#include "pipeline/scan/open_vertices.h"
#include "pipeline/scan/simplify.h"

namespace rbvh {
namespace {

constexpr std::size_t kGrain = 1 << 14;
constexpr std::uint32_t kNone = 0xffffffffu;
/// Of 255: the largest difference between colours of vertices that are one.
constexpr int kSameColor = 32;

std::uint64_t hash_of(Vec3f p) {
  std::uint64_t hash = 0;
  for (int axis = 0; axis < 3; ++axis)
    hash = (hash ^ std::bit_cast<std::uint32_t>(p[axis] + 0.0f)) * 0x9e3779b97f4a7c15u;
  return hash ^ (hash >> 29);
}

/// Of each of the scan's triangles whether it stays.
std::vector<std::uint8_t> find_staying(const RefinedLevel& level, const Scan& scan,
                                       std::span<const std::uint32_t> first_at_place, float largest_flap) {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> numbers;  // in the scan
  std::vector<std::int32_t> objects;
  std::vector<std::uint8_t> stays(scan.triangles.size(), 0);
  for (const std::vector<std::uint32_t>& held : level.held)
    for (const std::uint32_t i : held) {
      const auto& [a, b, c] = scan.triangles[i];
      const Triangle placed{first_at_place[a], first_at_place[b], first_at_place[c]};
      if (placed[0] == placed[1] || placed[1] == placed[2] || placed[2] == placed[0]) continue;
      stays[i] = 1;
      triangles.push_back(placed);
      numbers.push_back(i);
      if (!scan.object_ids.empty()) objects.push_back(scan.object_ids[i]);
    }
  CoincidentCounts counts;
  const std::vector<FaceFate> fates =
      settle_coincident(triangles, scan.positions, objects, largest_flap, counts);
  for (std::size_t k = 0; k < fates.size(); ++k)
    if (fates[k] == FaceFate::kGoes || fates[k] == FaceFate::kSheetsBack) stays[numbers[k]] = 0;
  return stays;
}

using Cell = std::array<std::int32_t, 3>;
/// Of one object: two places, the smaller first; a place twice.
using ThinEdge = std::tuple<std::int32_t, Cell, Cell>;

/// Where two corners of a triangle come to lie, which have one place or two.
class ThinParts {
 public:
  ThinParts(Scan& scan, const Lattice& lattice, std::span<const std::uint8_t> stays)
      : scan_(scan), lattice_(lattice), stays_(stays) {}

  void widen() {
    std::vector<std::uint8_t> is_thin(scan_.triangles.size());
    parallel_for(is_thin.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) is_thin[i] = has_area(cells_of(i)) ? 0 : 1;
    });
    for (std::uint32_t i = 0; i < is_thin.size(); ++i) {
      if (is_thin[i] == 0) continue;
      const ThinEdge edge = edge_of(i);
      edges_.try_emplace(edge, i);
      for (const Cell& cell : {std::get<1>(edge), std::get<2>(edge)}) has_thin_[slot(cell)] = true;
    }
    if (edges_.empty()) return;
    for (std::uint32_t i = 0; i < is_thin.size(); ++i)
      if (is_thin[i] == 0) pass_over(i);
    if (edges_.empty()) return;
    std::vector<std::uint32_t> waiting;
    for (const auto& [edge, i] : edges_) waiting.push_back(i);
    std::sort(waiting.begin(), waiting.end());
    is_open_ = open_vertices(scan_.positions.size(), scan_.triangles);
    for (const std::uint32_t i : waiting)
      if (!has_area(cells_of(i))) widen(i);
  }

 private:
  std::array<Cell, 3> cells_of(std::size_t i) const {
    std::array<Cell, 3> cells;
    for (std::size_t c = 0; c < 3; ++c)
      for (int axis = 0; axis < 3; ++axis)
        cells[c][static_cast<std::size_t>(axis)] =
            lattice_number(lattice_, scan_.positions[scan_.triangles[i][c]], axis);
    return cells;
  }
  static bool has_area(const std::array<Cell, 3>& c) {
    const auto side = [&](std::size_t to) {
      return Vec3d{static_cast<double>(c[to][0]) - c[0][0], static_cast<double>(c[to][1]) - c[0][1],
                   static_cast<double>(c[to][2]) - c[0][2]};
    };
    return cross(side(1), side(2)) != Vec3d{};
  }
  std::int32_t object(std::size_t i) const { return scan_.object_ids.empty() ? 0 : scan_.object_ids[i]; }

  ThinEdge edge_of(std::size_t i) const {
    const auto [a, b, c] = cells_of(i);
    return {object(i), std::min({a, b, c}), std::max({a, b, c})};
  }
  static std::size_t slot(const Cell& cell) {
    std::uint32_t hash = 0;
    for (const std::int32_t number : cell) hash = (hash ^ static_cast<std::uint32_t>(number)) * 0x9e3779b1u;
    return hash >> 16;
  }

  /// A triangle that stays: its edges are there.
  void pass_over(std::size_t i) {
    const std::array<Cell, 3> cells = cells_of(i);
    for (std::size_t c = 0; c < 3; ++c) {
      if (!has_thin_[slot(cells[c])]) continue;
      const Cell &from = cells[c], &to = cells[(c + 1) % 3];
      edges_.erase({object(i), from, from});
      edges_.erase({object(i), std::min(from, to), std::max(from, to)});
      used_.insert(from);
    }
  }

  /// Moves corners that share a cell apart, along axes across the triangle's longest extent.
  void widen(std::size_t i) {
    const Triangle& t = scan_.triangles[i];
    Vec3f extent;
    for (int axis = 0; axis < 3; ++axis)
      extent[axis] = std::max({std::abs(scan_.positions[t[1]][axis] - scan_.positions[t[0]][axis]),
                               std::abs(scan_.positions[t[2]][axis] - scan_.positions[t[1]][axis])});
    std::array<int, 3> axes = {0, 1, 2};
    std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return extent[a] < extent[b]; });
    const std::array<Cell, 3> cells = cells_of(i);
    // A vertex where the surface is open may have another beside it, which would stay.
    const bool is_alone =
        std::none_of(cells.begin(), cells.end(), [&](const Cell& cell) { return used_.contains(cell); });
    std::size_t moved = 0;
    for (std::size_t c = 1; c < 3; ++c) {
      if ((is_open_[t[c]] && !is_alone) || (!stays_.empty() && stays_[t[c]] != 0)) continue;
      if (cells[c] != cells[0] && (c == 1 || (moved > 0 && cells[2] != cells[1]))) continue;
      Vec3f& p = scan_.positions[t[c]];
      const int axis = axes[moved++];
      p[axis] = lattice_place(lattice_, cells[c][static_cast<std::size_t>(axis)] + 1, axis);
    }
  }

  Scan& scan_;
  const Lattice& lattice_;
  std::span<const std::uint8_t> stays_;
  std::map<ThinEdge, std::uint32_t> edges_;  ///< with the first of their triangles
  std::vector<bool> has_thin_ =
      std::vector<bool>(1 << 16);  ///< of hashes of cells, whether any is an end of them
  std::set<Cell> used_;            ///< of these cells: those that triangles with area use
  std::vector<bool> is_open_;
};

}  // namespace

void widen_thin_parts(Scan& scan, const Lattice& lattice, std::span<const std::uint8_t> stays) {
  if (lattice.step > 0 && !scan.is_cloud()) ThinParts(scan, lattice, stays).widen();
}

PrimitiveVertices::PrimitiveVertices(const Scan& scan, std::span<const Vec3f> normals,
                                     std::span<const std::uint32_t> copies, const Lattice& lattice,
                                     std::span<const Vec3f> places,
                                     std::span<const std::uint32_t> first_at_place, Scan& to)
    : scan_(scan),
      normals_(normals),
      copies_(copies),
      lattice_(lattice),
      places_(places),
      first_at_place_(first_at_place),
      to_(to),
      numbers_(normals.size(), kNone),
      last_at_place_(first_at_place.size(), kNone) {}

bool PrimitiveVertices::are_alike(std::uint32_t number, Vec3f normal, std::uint32_t vertex) const {
  // Normals of the scan's own tell edges from the rest; those that follow from its faces only tell sides.
  if (dot(to_.normals[number], normal) < (scan_.normals.empty() ? kCreaseCosine : kAlikeNormal)) return false;
  if (scan_.colors.empty()) return true;
  const Color8 &a = to_.colors[number], &b = scan_.colors[vertex];
  for (std::size_t c = 0; c < 3; ++c)
    if (std::abs(int{a[c]} - int{b[c]}) > kSameColor) return false;
  return true;
}

std::uint32_t PrimitiveVertices::add(std::uint32_t side) {
  std::uint32_t& number = numbers_[side];
  if (number != kNone) return number;
  const auto count = static_cast<std::uint32_t>(scan_.positions.size());
  const std::uint32_t vertex = side < count ? side : copies_[side - count];
  const auto unit = static_cast<Vec3f>(normalized(static_cast<Vec3d>(normals_[side])));
  const Vec3f normal = lattice_.step > 0 ? unpack_normal(pack_normal(unit)) : unit;
  number = static_cast<std::uint32_t>(to_.positions.size());
  if (!scan_.is_cloud()) {
    std::uint32_t& last = last_at_place_[first_at_place_[vertex]];
    for (std::uint32_t other = last; other != kNone; other = before_[other])
      if (are_alike(other, normal, vertex)) return number = other;
    before_.push_back(std::exchange(last, number));
  }
  to_.positions.push_back(places_[vertex]);
  to_.normals.push_back(normal);
  if (!scan_.colors.empty()) to_.colors.push_back(scan_.colors[vertex]);
  return number;
}

// A hash table with linear probing, at most half full.
std::vector<std::uint32_t> find_first_at_place(const RefinedLevel& level, const Scan& scan,
                                               std::span<const Vec3f> places) {
  std::vector<std::uint32_t> first(scan.positions.size(), kNone), vertices;
  for (const std::vector<std::uint32_t>& held : level.held)
    for (const std::uint32_t i : held)
      for (const std::uint32_t v : scan.triangles[i])
        if (first[v] == kNone) {
          first[v] = v;
          vertices.push_back(v);
        }
  std::vector<std::uint32_t> slots(std::bit_ceil(2 * vertices.size() + 1), kNone);
  for (const std::uint32_t v : vertices) {
    std::size_t at = hash_of(places[v]) & (slots.size() - 1);
    while (slots[at] != kNone && places[slots[at]] != places[v]) at = (at + 1) & (slots.size() - 1);
    if (slots[at] == kNone) slots[at] = v;
    first[v] = slots[at];
  }
  return first;
}

void drop_collapsed(RefinedLevel& level, const Scan& scan, std::span<const std::uint32_t> first_at_place,
                    const Lattice& lattice) {
  const std::vector<std::uint8_t> stays =
      find_staying(level, scan, first_at_place, kLargestFold * lattice.step);
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
}

}  // namespace rbvh
