#include "tests/bench/twin.h"

#include <meshoptimizer.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace rbvh::bench {
namespace {

constexpr int kMostTrials = 16;
constexpr double kNearTolerance = 0.03;  // where the search ends: well within kTwinTolerance
constexpr double kLeastBracket = 1.01;   // of two triangle counts, which are then as good as one
constexpr double kMostStep = 16;         // of a triangle count, where only one side is known
constexpr float kAnyError = 1;           // of the extent: decimation ends by count alone
constexpr int kZstdLevel = 19;

using Bytes = std::vector<unsigned char>;
using StoredVertex = std::array<std::uint16_t, 4>;  // the codec wants a multiple of 4 bytes; the last is 0

/// The number of triangles to try next: where a power law through both trials has the error, but not at an
/// end of the bracket. Without a coarse one, as errors are about inverse to the number of triangles.
double next_trial(const TwinTrial& coarse, const TwinTrial& fine, double error) {
  if (coarse.triangles == 0) return fine.triangles * std::clamp(fine.error / error, 1 / kMostStep, 0.5);
  const double whole = std::log(fine.triangles / coarse.triangles);
  double share = 0.5;
  if (fine.error > 0) share = std::log(coarse.error / error) / std::log(coarse.error / fine.error);
  return coarse.triangles * std::exp(whole * std::clamp(share, 0.1, 0.9));
}

std::size_t zstd_bytes(const Bytes& bytes) {
  Bytes packed(ZSTD_compressBound(bytes.size()));
  return ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), kZstdLevel);
}

std::vector<StoredVertex> quantized(const Scan& mesh) {
  const Bounds3f box = bounds(mesh);
  std::vector<StoredVertex> vertices(mesh.positions.size());
  for (std::size_t i = 0; i < vertices.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const float extent = box.hi[axis] - box.lo[axis];
      const float share = extent > 0 ? (mesh.positions[i][axis] - box.lo[axis]) / extent : 0;
      vertices[i][static_cast<std::size_t>(axis)] = static_cast<std::uint16_t>(std::lround(share * 65535));
    }
  return vertices;
}

}  // namespace

Scan decimate(const Scan& scan, std::size_t triangles) {
  const std::size_t vertices = scan.positions.size();
  const float* positions = &scan.positions.front().x;
  Scan mesh;
  mesh.triangles.resize(scan.triangles.size());
  std::uint32_t* indices = mesh.triangles.front().data();
  const std::size_t count = meshopt_simplify(
      indices, scan.triangles.front().data(), scan.triangles.size() * 3, positions, vertices, sizeof(Vec3f),
      std::min(triangles * 3, mesh.triangles.size() * 3), kAnyError, 0, nullptr);
  mesh.triangles.resize(count / 3);
  meshopt_optimizeVertexCache(indices, indices, count, vertices);
  mesh.positions.resize(vertices);
  mesh.positions.resize(
      meshopt_optimizeVertexFetch(mesh.positions.data(), indices, count, positions, vertices, sizeof(Vec3f)));
  return mesh;
}

Twin find_twin(const Scan& scan, double error, const std::function<double(const Scan&)>& measure_error,
               std::vector<TwinTrial>& known) {
  const auto whole = static_cast<double>(scan.triangles.size());
  TwinTrial fine{whole, 0}, coarse;  // the bracket; none coarse yet
  for (const TwinTrial& trial : known) {
    if (trial.error < error && trial.triangles < fine.triangles) fine = trial;
    if (trial.error >= error && trial.triangles > coarse.triangles) coarse = trial;
  }
  Twin best;
  double best_distance = 0;
  for (int i = 0; i < kMostTrials; ++i) {
    const double wished = error > 0 ? std::max(1.0, next_trial(coarse, fine, error)) : whole;
    Scan mesh = decimate(scan, static_cast<std::size_t>(wished));
    const TwinTrial trial{static_cast<double>(mesh.triangles.size()), measure_error(mesh)};
    known.push_back(trial);
    best.trials = i + 1;
    const double distance = std::abs(std::log(trial.error / error));
    if (i == 0 || distance <= best_distance) {  // of equals the one that is nearer to the jump
      best.mesh = std::move(mesh);
      best.error = trial.error;
      best_distance = distance;
    }
    if (!(error > 0) || distance <= std::log1p(kNearTolerance)) break;
    const bool is_fine = trial.error < error;
    if (is_fine && trial.triangles >= fine.triangles) break;  // there is nothing coarser
    (is_fine ? fine : coarse) = trial;
    if (fine.triangles < coarse.triangles * kLeastBracket) break;
  }
  return best;
}

MeshBytes stored_bytes(const Scan& mesh) {
  const std::vector<StoredVertex> vertices = quantized(mesh);
  const std::size_t corners = mesh.triangles.size() * 3;
  Bytes indices(meshopt_encodeIndexBufferBound(corners, vertices.size()));
  indices.resize(
      meshopt_encodeIndexBuffer(indices.data(), indices.size(), mesh.triangles.front().data(), corners));
  Bytes plain;
  for (const StoredVertex& vertex : vertices)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      plain.push_back(static_cast<unsigned char>(vertex[axis] & 0xff));
      plain.push_back(static_cast<unsigned char>(vertex[axis] >> 8));
    }
  plain.insert(plain.end(), indices.begin(), indices.end());

  Bytes encoded(meshopt_encodeVertexBufferBound(vertices.size(), sizeof(StoredVertex)));
  encoded.resize(meshopt_encodeVertexBuffer(encoded.data(), encoded.size(), vertices.data(), vertices.size(),
                                            sizeof(StoredVertex)));
  encoded.insert(encoded.end(), indices.begin(), indices.end());

  MeshBytes bytes;
  bytes.plain = plain.size();
  bytes.zstd = std::min(bytes.plain, zstd_bytes(plain));
  bytes.best = std::min(bytes.zstd, zstd_bytes(encoded));
  return bytes;
}

}  // namespace rbvh::bench
