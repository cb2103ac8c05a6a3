// Writes a surface of any number of triangles without ever holding it: a sphere of rough terrain, row by row,
// as a binary PLY.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <vector>

namespace {

/// Smooth noise in [-1, 1]: random values at whole numbers, blended.
double noise(double x, double y, double z) {
  const auto at = [](std::int64_t i, std::int64_t j, std::int64_t k) {
    std::uint64_t h = static_cast<std::uint64_t>(i) * 0x9e3779b97f4a7c15u ^
                      static_cast<std::uint64_t>(j) * 0xc2b2ae3d27d4eb4fu ^
                      static_cast<std::uint64_t>(k) * 0x165667b19e3779f9u;
    h = (h ^ (h >> 31)) * 0xbf58476d1ce4e5b9u;
    h ^= h >> 29;
    return static_cast<double>(h >> 11) / static_cast<double>(1ull << 52) - 1;
  };
  const double fx = std::floor(x), fy = std::floor(y), fz = std::floor(z);
  const auto i = static_cast<std::int64_t>(fx), j = static_cast<std::int64_t>(fy),
             k = static_cast<std::int64_t>(fz);
  const auto ease = [](double t) { return t * t * (3 - 2 * t); };
  const double u = ease(x - fx), v = ease(y - fy), w = ease(z - fz);
  double sum = 0;
  for (int c = 0; c < 8; ++c)
    sum += ((c & 1) != 0 ? u : 1 - u) * ((c & 2) != 0 ? v : 1 - v) * ((c & 4) != 0 ? w : 1 - w) *
           at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
  return sum;
}

void write_point(std::vector<float>& row, double s, double t) {
  const double phi = 6.283185307179586 * s, theta = 3.141592653589793 * t;
  const double x = std::sin(theta) * std::cos(phi), y = std::cos(theta), z = std::sin(theta) * std::sin(phi);
  double r = 1, height = 0.12;
  for (double scale = 2; scale < 3000; scale *= 2.3, height *= 0.45)
    r += height * noise(scale * x, scale * y, scale * z);
  for (const double c : {r * x, r * y, r * z}) row.push_back(static_cast<float>(c));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "make_surface TRIANGLES OUT.ply\n";
    return 2;
  }
  // Around: twice as many as from pole to pole.
  const auto rows = static_cast<std::uint32_t>(std::max(2.0, std::sqrt(std::atof(argv[1]) / 4)));
  const std::uint32_t columns = 2 * rows;
  const std::uint64_t vertices = std::uint64_t{rows + 1} * columns,
                      triangles = std::uint64_t{2} * rows * columns;
  std::ofstream out(argv[2], std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << vertices
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << triangles
      << "\nproperty list uchar int vertex_indices\nend_header\n";
  std::vector<float> row;
  for (std::uint32_t j = 0; j <= rows; ++j) {
    row.clear();
    for (std::uint32_t i = 0; i < columns; ++i)
      write_point(row, static_cast<double>(i) / columns, static_cast<double>(j) / rows);
    out.write(reinterpret_cast<const char*>(row.data()),
              static_cast<std::streamsize>(row.size() * sizeof(float)));
  }
  std::vector<char> faces;
  for (std::uint32_t j = 0; j < rows; ++j) {
    faces.clear();
    for (std::uint32_t i = 0; i < columns; ++i) {
      const std::uint32_t next = (i + 1) % columns, a = j * columns + i, b = j * columns + next,
                          c = a + columns, d = b + columns;
      const std::uint32_t corners[] = {a, b, c, b, d, c};
      for (const std::size_t first : {std::size_t{0}, std::size_t{3}}) {
        faces.push_back(3);
        const auto* bytes = reinterpret_cast<const char*>(corners + first);
        faces.insert(faces.end(), bytes, bytes + 3 * sizeof corners[0]);
      }
    }
    out.write(faces.data(), static_cast<std::streamsize>(faces.size()));
  }
  out.close();
  if (!out) {
    std::cerr << argv[2] << ": cannot be written\n";
    return 1;
  }
  return 0;
}
