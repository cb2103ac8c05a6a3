#include "chunks/split_cells.h"

#include <cmath>

namespace rbvh {
namespace {

template <class Visit>
void for_each_box(const Cell& cell, Visit&& visit) {
  std::array<int, 3> at{};
  for (at[2] = cell.lo[2]; at[2] < cell.hi[2]; ++at[2])
    for (at[1] = cell.lo[1]; at[1] < cell.hi[1]; ++at[1])
      for (at[0] = cell.lo[0]; at[0] < cell.hi[0]; ++at[0]) visit(at);
}

/// Leaves the empty boxes at its sides out.
Cell shrunk(const SpaceGrid& grid, const Cell& cell) {
  Cell tight{{kGridSide, kGridSide, kGridSide}, {0, 0, 0}, 0};
  for_each_box(cell, [&](const std::array<int, 3>& at) {
    const std::uint32_t count = grid.counts[SpaceGrid::index(at)];
    if (count == 0) return;
    tight.primitives += count;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      tight.lo[axis] = std::min(tight.lo[axis], at[axis]);
      tight.hi[axis] = std::max(tight.hi[axis], at[axis] + 1);
    }
  });
  return tight;
}

/// Where the cell is cut along the axis so that about `share` of its primitives lie before the cut.
int find_cut(const SpaceGrid& grid, const Cell& cell, std::size_t axis, double share) {
  std::vector<std::uint64_t> slices(kGridSide, 0);
  for_each_box(cell, [&](const std::array<int, 3>& at) {
    slices[static_cast<std::size_t>(at[axis])] += grid.counts[SpaceGrid::index(at)];
  });
  int best = cell.lo[axis] + 1;
  double least = INFINITY;
  std::uint64_t before = 0;
  for (int cut = cell.lo[axis] + 1; cut < cell.hi[axis]; ++cut) {
    before += slices[static_cast<std::size_t>(cut - 1)];
    const double apart = std::abs(static_cast<double>(before) - share * static_cast<double>(cell.primitives));
    if (apart < least) {
      least = apart;
      best = cut;
    }
  }
  return best;
}

void split(const SpaceGrid& grid, const Cell& whole, std::uint32_t count, std::vector<Cell>& cells) {
  const Cell cell = shrunk(grid, whole);
  std::size_t longest = 0;
  const auto side = [&](std::size_t axis) {
    const int boxes = cell.hi[axis] - cell.lo[axis];
    return boxes < 2 ? -1.0f : static_cast<float>(boxes) * grid.box[static_cast<int>(axis)];
  };
  for (std::size_t axis = 1; axis < 3; ++axis)
    if (side(axis) > side(longest)) longest = axis;
  if (count < 2 || side(longest) < 0) {
    cells.push_back({whole.lo, whole.hi, cell.primitives});
    return;
  }
  const std::uint32_t before = count / 2;
  const int cut = find_cut(grid, cell, longest, static_cast<double>(before) / static_cast<double>(count));
  Cell half = whole;
  half.hi[longest] = cut;
  split(grid, half, before, cells);
  half = whole;
  half.lo[longest] = cut;
  split(grid, half, count - before, cells);
}

}  // namespace

std::vector<Cell> split_cells(const SpaceGrid& grid, std::uint32_t count) {
  std::vector<Cell> cells;
  split(grid, {{0, 0, 0}, {kGridSide, kGridSide, kGridSide}, 0}, count, cells);
  return cells;
}

std::vector<std::uint16_t> cells_of_boxes(const std::vector<Cell>& cells) {
  std::vector<std::uint16_t> numbers(std::size_t{kGridSide} * kGridSide * kGridSide, 0xffff);
  for (std::size_t i = 0; i < cells.size(); ++i)
    for_each_box(cells[i], [&](const std::array<int, 3>& at) {
      numbers[SpaceGrid::index(at)] = static_cast<std::uint16_t>(i);
    });
  return numbers;
}

}  // namespace rbvh
