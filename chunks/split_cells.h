// Cuts a scan into cells with about as many primitives each: a k-d tree over the boxes of its grid.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "chunks/survey.h"

namespace rbvh {

/// A block of the grid's boxes: lo .. hi - 1 along each axis.
struct Cell {
  std::array<int, 3> lo{}, hi{};
  std::uint64_t primitives = 0;  ///< whose centres lie in it
};

/// `count` cells, or fewer where primitives lie in fewer boxes; none is empty. Together they are the whole
/// grid.
std::vector<Cell> split_cells(const SpaceGrid& grid, std::uint32_t count);

/// Of each of the grid's boxes the number of its cell.
std::vector<std::uint16_t> cells_of_boxes(const std::vector<Cell>& cells);

}  // namespace rbvh
