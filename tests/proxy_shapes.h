// Procedural proxies. Displacement is a function of the base point alone, and base points on a shared edge
// are the same to the last bit, so that any quad mesh without hanging vertices gives a surface without
// cracks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <span>
#include <vector>

#include "pipeline/base/parallel_for.h"
#include "pipeline/proxy/proxy.h"

namespace rbvh {

struct QuadMesh {
  std::vector<Vec3f> positions;
  std::vector<Quad> quads;
};

/// n x m quads over [0,1]^2, mapped by `place`. Rings close where `wraps`: the last column is the first one.
inline QuadMesh quad_sheet(std::uint32_t n, std::uint32_t m,
                           const std::function<Vec3f(float s, float t)>& place, bool wraps = false) {
  QuadMesh mesh;
  const std::uint32_t columns = wraps ? n : n + 1;
  for (std::uint32_t j = 0; j <= m; ++j)
    for (std::uint32_t i = 0; i < columns; ++i)
      mesh.positions.push_back(place(static_cast<float>(i) / static_cast<float>(n),
                                     static_cast<float>(j) / static_cast<float>(m)));
  for (std::uint32_t j = 0; j < m; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * columns + i, b = j * columns + (i + 1) % columns;
      mesh.quads.push_back({a, b, b + columns, a + columns});
    }
  return mesh;
}

/// A closed unit sphere of 6 n^2 quads, facing outwards.
inline QuadMesh quad_sphere(std::uint32_t n) {
  QuadMesh mesh;
  const std::uint32_t side = n + 1;
  std::vector<std::uint32_t> vertex(std::size_t{side} * side * side, 0xffffffffu);
  const auto on_cube = [&](std::array<std::uint32_t, 3> c) {
    std::uint32_t& index = vertex[(std::size_t{c[2]} * side + c[1]) * side + c[0]];
    if (index == 0xffffffffu) {
      index = static_cast<std::uint32_t>(mesh.positions.size());
      Vec3f p;
      for (std::size_t axis = 0; axis < 3; ++axis)  // even angles
        p[static_cast<int>(axis)] = std::tan(std::numbers::pi_v<float> / 4 *
                                             (2 * static_cast<float>(c[axis]) / static_cast<float>(n) - 1));
      mesh.positions.push_back(normalized(p));
    }
    return index;
  };
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const bool far : {false, true})
      for (std::uint32_t j = 0; j < n; ++j)
        for (std::uint32_t i = 0; i < n; ++i) {
          const auto at = [&](std::uint32_t x, std::uint32_t y) {
            std::array<std::uint32_t, 3> c{};
            c[axis] = far ? n : 0;
            c[(axis + 1) % 3] = far ? x : y;
            c[(axis + 2) % 3] = far ? y : x;
            return on_cube(c);
          };
          mesh.quads.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
  return mesh;
}

/// `levels`: of each quad's tile, or one for all.
inline Proxy displaced(const QuadMesh& mesh, std::span<const std::uint32_t> levels,
                       const std::function<Vec3f(Vec3f)>& displacement) {
  Proxy proxy;
  proxy.positions = mesh.positions;
  proxy.quads = mesh.quads;
  const auto level = [&](std::size_t quad) { return levels.size() == 1 ? levels[0] : levels[quad]; };
  std::uint32_t largest = 0;
  for (std::size_t q = 0; q < mesh.quads.size(); ++q) largest = std::max(largest, (1u << level(q)) + 1);
  const auto columns =
      static_cast<std::uint32_t>(std::clamp<std::size_t>(mesh.quads.size(), 1, std::max(1u, 8192 / largest)));
  const auto rows = static_cast<std::uint32_t>((mesh.quads.size() + columns - 1) / columns);
  proxy.map_width = columns * largest;
  proxy.map_height = rows * largest;
  proxy.map.resize(std::size_t{proxy.map_width} * proxy.map_height);
  proxy.tiles.resize(mesh.quads.size());
  parallel_for(mesh.quads.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t q = begin; q < end; ++q) {
      PatchTile& tile = proxy.tiles[q];
      tile.x = static_cast<std::uint32_t>(q % columns) * largest;
      tile.y = static_cast<std::uint32_t>(q / columns) * largest;
      tile.side = (1u << level(q)) + 1;
      const auto corner = [&](std::size_t k) { return mesh.positions[mesh.quads[q][k]]; };
      for (std::uint32_t j = 0; j < tile.side; ++j)
        for (std::uint32_t i = 0; i < tile.side; ++i) {
          const float s = static_cast<float>(i) / static_cast<float>(tile.side - 1);
          const float t = static_cast<float>(j) / static_cast<float>(tile.side - 1);
          const Vec3f d = displacement((corner(0) * (1 - s) + corner(1) * s) * (1 - t) +
                                       (corner(3) * (1 - s) + corner(2) * s) * t);
          tile.longest_displacement = std::max(tile.longest_displacement, length(d));
          proxy.map[std::size_t{tile.y + j} * proxy.map_width + tile.x + i] = d;
        }
    }
  });
  return proxy;
}

/// Smooth bumps in all directions, of several sizes.
inline Vec3f ripples(Vec3f p, float frequency, int octaves) {
  Vec3f sum{};
  float weight = 1;
  for (int octave = 0; octave < octaves; ++octave) {
    const float f = frequency * std::pow(2.0f, static_cast<float>(octave));
    sum = sum + Vec3f{std::sin(f * p.y + 1.3f) * std::cos(f * p.z),
                      std::sin(f * p.z + 2.1f) * std::cos(f * p.x),
                      std::sin(f * p.x + 0.7f) * std::cos(f * p.y)} *
                    weight;
    weight *= 0.5f;
  }
  return sum;
}

/// A sphere's point moved so that the surface overhangs: mushrooms that are also twisted.
inline Vec3f mushrooms(Vec3f p, float height) {
  const Vec3f n = normalized(p);
  const float wave = std::sin(7 * n.x) * std::sin(7 * n.y + 1) * std::sin(7 * n.z + 2);
  const float bump = height * std::tanh(4 * wave);
  // Sideways, away from the bump's middle, the further out the more: necks under caps.
  const Vec3f along = {7 * std::cos(7 * n.x) * std::sin(7 * n.y + 1) * std::sin(7 * n.z + 2),
                       7 * std::sin(7 * n.x) * std::cos(7 * n.y + 1) * std::sin(7 * n.z + 2),
                       7 * std::sin(7 * n.x) * std::sin(7 * n.y + 1) * std::cos(7 * n.z + 2)};
  const Vec3f side = along - n * dot(along, n);
  const float spread = -0.06f * height * (1 + std::tanh(6 * wave));
  return n * bump + side * spread;
}

}  // namespace rbvh
