// The twin of a level: the mesh with as few triangles as the level's error allows (Garland, Heckbert,
// "Surface simplification using quadric error metrics", 1997, by meshoptimizer).
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "rbvh/scan.h"

namespace rbvh::bench {

/// `scan` with about `triangles` triangles, or more where its topology has no fewer; positions and triangles
/// alone, in an order that encodes and caches well. Vertices stay where they are.
Scan decimate(const Scan& scan, std::size_t triangles);

/// What decimation to so many triangles left as error.
struct TwinTrial {
  double triangles = 0, error = 0;
};

struct Twin {
  Scan mesh;
  double error = 0;
  int trials = 0;  ///< meshes that were measured
};

/// How far from the wished error a twin may be, as a share of it.
inline constexpr double kTwinTolerance = 0.05;

/// Looks for the mesh of that error between those of `known`, trials of the same scan, and adds its own.
/// Where errors jump over `error`, or are never as large, the nearest; the whole mesh for no error.
Twin find_twin(const Scan& scan, double error, const std::function<double(const Scan&)>& measure_error,
               std::vector<TwinTrial>& known);

/// What a mesh takes in a file.
struct MeshBytes {
  std::size_t plain = 0;  ///< positions of 3 x 16 bits in its box, indices by meshopt_encodeIndexBuffer()
  std::size_t zstd = 0;   ///< the smaller of that and that through zstd
  std::size_t best = 0;   ///< positions by meshopt_encodeVertexBuffer(), too, then zstd; or the smaller above
};
MeshBytes stored_bytes(const Scan& mesh);

}  // namespace rbvh::bench
