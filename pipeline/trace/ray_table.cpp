#include "pipeline/trace/ray_table.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <limits>

#include "pipeline/base/stopwatch.h"
#include "pipeline/device/device.h"
#include "rbvh/geometry.h"
#include "rbvh/ray_rows.h"

namespace rbvh {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 18;  // rays
constexpr std::size_t kPieces = 3;                    // one is read, one cast, one written
// Squared lengths outside these would overflow or vanish in the kernels' own arithmetic.
constexpr float kLeastSquare = 1e-20f, kMostSquare = 1e20f;

/// A ray as the kernels can take it; t of its hits times `scale` is t as the user has it.
struct ScaledRay {
  Ray ray{};
  float scale = 1;
  bool usable = false;  // finite, with a direction
};

ScaledRay scale_ray(const float* row, std::size_t columns) {
  ScaledRay p;
  Ray& ray = p.ray;
  std::copy(row, row + 3, ray.origin);
  std::copy(row + 3, row + 6, ray.direction);
  ray.tmin = columns == 8 ? row[6] : 0;
  ray.tmax = columns == 8 ? row[7] : std::numeric_limits<float>::infinity();
  const Vec3d d{static_cast<double>(row[3]), static_cast<double>(row[4]), static_cast<double>(row[5])};
  const double size = length(d);
  p.usable = is_finite(Vec3f{row[0], row[1], row[2]}) && is_finite(d) && size > 0 && !std::isnan(ray.tmin) &&
             !std::isnan(ray.tmax);
  if (p.usable && !(size * size >= kLeastSquare && size * size <= kMostSquare)) {
    for (int axis = 0; axis < 3; ++axis) ray.direction[axis] = static_cast<float>(d[axis] / size);
    ray.tmin = static_cast<float>(ray.tmin * size);
    ray.tmax = static_cast<float>(ray.tmax * size);
    p.scale = static_cast<float>(1 / size);
  }
  if (!p.usable) ray = {{0, 0, 0}, 1, {0, 0, 1}, 0};  // an empty interval: hits nothing
  return p;
}

/// The hit of the ray as the user has it.
void unscale(const ScaledRay& ray, Hit& hit) {
  if (ray.usable && std::isfinite(hit.t))
    hit.t *= ray.scale;
  else
    hit = {std::numeric_limits<float>::infinity(), {0, 0, 0}, 0, 0, RBVH_NO_LEAF, 0};
}

/// Some rays on their way through.
struct Piece {
  std::size_t count = 0;
  std::vector<ScaledRay> scaled;
  std::vector<Ray> rays;
  std::vector<Hit> hits;
};

std::size_t piece_rays(std::uint64_t rays) {
  return static_cast<std::size_t>(std::clamp<std::uint64_t>(rays, 1, kPiece));
}

void read_piece(const RayStream& stream, Piece& piece, RayTableCounts& counts) {
  std::vector<float> rows(piece_rays(stream.rows) * stream.columns);
  piece.count = stream.read(rows);
  piece.scaled.resize(piece.count);
  piece.rays.resize(piece.count);
  piece.hits.resize(piece.count);
  for (std::size_t i = 0; i < piece.count; ++i) {
    piece.scaled[i] = scale_ray(&rows[i * stream.columns], stream.columns);
    piece.rays[i] = piece.scaled[i].ray;
    counts.unusable += !piece.scaled[i].usable;
  }
}

void write_piece(const RayStream& stream, Piece& piece, RayTableCounts& counts) {
  for (std::size_t i = 0; i < piece.count; ++i) {
    unscale(piece.scaled[i], piece.hits[i]);
    counts.hits += piece.hits[i].leaf != RBVH_NO_LEAF;
  }
  stream.write(piece.hits);
}

/// Of what has been read to its end there is nothing to stop.
struct Stopper {
  const RayStream& stream;
  ~Stopper() {
    if (stream.stop) stream.stop();
  }
};

}  // namespace

std::uint64_t ray_stream_bytes(std::uint64_t rays) {
  constexpr std::uint64_t kRow = kHitColumns * sizeof(float);
  return piece_rays(rays) *
         (kPieces * (sizeof(ScaledRay) + sizeof(Ray) + sizeof(Hit)) + 2 * kRow + sizeof(Ray) + sizeof(Hit));
}

RayTableCounts trace_stream(const Tracer& tracer, const RayStream& stream, RayQuery query,
                            const Progress& progress) {
  RayTableCounts counts;
  Piece pieces[kPieces];
  Buffer<Ray> rays(tracer.device, piece_rays(stream.rows));
  const Buffer<Hit> hits(tracer.device, rays.size());
  const auto read = [&](Piece& piece) {
    return std::async(std::launch::async, [&] { read_piece(stream, piece, counts); });
  };
  std::future<void> reading = read(pieces[0]), writing;
  const Stopper stopper{stream};  // before the futures wait for their threads
  for (std::size_t k = 0;; ++k) {
    Piece& piece = pieces[k % kPieces];
    try {
      reading.get();
    } catch (...) {
      if (writing.valid()) writing.get();  // throws what made it stop
      throw;
    }
    if (piece.count == 0) break;
    reading = read(pieces[(k + 1) % kPieces]);  // whose hits have been written: two pieces ago
    report(progress, "trace", static_cast<double>(counts.rays) / static_cast<double>(stream.rows));
    Stopwatch watch;
    rays.write(piece.rays);
    tracer.intersect(rays, hits, piece.count, query);
    hits.read(piece.hits);
    counts.seconds += watch.lap();
    counts.rays += piece.count;
    if (writing.valid()) writing.get();
    writing = std::async(std::launch::async, [&] {
      try {
        write_piece(stream, piece, counts);
      } catch (...) {
        if (stream.stop) stream.stop();
        throw;
      }
    });
  }
  if (writing.valid()) writing.get();
  return counts;
}

std::vector<float> hit_rows(std::span<const Hit> hits) {
  std::vector<float> rows(hits.size() * kHitColumns);
  float* row = rows.data();
  for (const Hit& hit : hits) {
    const bool found = hit.leaf != RBVH_NO_LEAF;
    const float values[kHitColumns] = {hit.t,
                                       hit.normal[0],
                                       hit.normal[1],
                                       hit.normal[2],
                                       hit.u,
                                       hit.v,
                                       found ? static_cast<float>(hit.leaf) : -1,
                                       static_cast<float>(hit.flags & RBVH_HIT_FLAGS)};
    row = std::copy_n(values, kHitColumns, row);
  }
  return rows;
}

std::uint64_t cast_rows(const Tracer& tracer, const RayRows& rays, RayQuery query,
                        const std::function<void(std::size_t first, std::span<const Hit>)>& write,
                        const Progress& progress) {
  std::size_t taken = 0, written = 0;
  const auto narrow = [&]<class T>(const T* from, std::span<float> to) {
    for (std::size_t i = 0; i < to.size(); i += rays.columns)
      for (std::size_t c = 0; c < rays.columns; ++c) {
        const T value = from[i + c];
        to[i + c] = static_cast<float>(c < 3 ? static_cast<double>(value) - rays.shift[static_cast<int>(c)]
                                             : static_cast<double>(value));
      }
  };
  RayStream stream;
  stream.columns = rays.columns;
  stream.rows = rays.rows;
  stream.read = [&](std::span<float> to) {
    const std::size_t rows = std::min(to.size() / rays.columns, rays.rows - taken);
    const std::size_t at = taken * rays.columns, count = rows * rays.columns;
    if (rays.is_double)
      narrow(static_cast<const double*>(rays.data) + at, to.first(count));
    else if (rays.shift != Vec3d{})
      narrow(static_cast<const float*>(rays.data) + at, to.first(count));
    else
      std::copy_n(static_cast<const float*>(rays.data) + at, count, to.begin());
    taken += rows;
    return rows;
  };
  stream.write = [&](std::span<const Hit> hits) {
    write(written, hits);
    written += hits.size();
  };
  return trace_stream(tracer, stream, query, progress).unusable;
}

}  // namespace rbvh
