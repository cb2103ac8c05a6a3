// Measures pictures by paths: the same path tracer over the exact scan, over a pair's levels (Q0 alone, and
// Q0 with secondary rays at coarser levels) and over Embree on the scan; and the error of the pictures
// against one of many samples. Reports figures; passes and fails nothing.
//   light_bench SCAN... [--resolution 512] [--samples 16] [--truth 1024]
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/device/device.h"
#include "pipeline/trace/camera_rays.h"
#include "pipeline/trace/surface.h"
#include "rbvh/build.h"
#include "rbvh/light.h"
#include "tests/bench/embree_scene.h"

namespace rbvh::bench {
namespace {

/// Embree behind the tracer's functions. Its rays and hits go through host memory, as PoCL's buffers do.
struct EmbreeTracer : Tracer {
  const Scan* scan;
  ShadingNormals normals;
  std::unique_ptr<EmbreeScene> embree;
  mutable double seconds = 0;  ///< of casting alone

  EmbreeTracer(const Device& on, const Scan& cast)
      : Tracer(on),
        scan(&cast),
        normals(shading_normals(cast)),
        embree(std::make_unique<EmbreeScene>(cast, embree_builds().back(), thread_count())) {}

  void intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count, RayQuery query,
                 const Buffer<std::uint32_t>*) const override {
    std::vector<Ray> batch(count);
    rays.read(std::span(batch));
    cast(batch, hits, query, false);
  }
  void intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                 const Buffer<std::uint32_t>*) const override {
    std::vector<Ray> batch(std::size_t{camera.width} * camera.height);
    for (std::size_t i = 0; i < batch.size(); ++i)
      batch[i] = pixel_ray(camera, static_cast<std::uint32_t>(i % camera.width),
                           static_cast<std::uint32_t>(i / camera.width));
    cast(batch, hits, RayQuery::kNearest, true);
  }
  SurfaceSamples surface(std::span<const Hit> hits, float spread) const override {
    return sample_surface(*scan, normals, TextureSampler(*scan), hits, spread);
  }
  std::uint64_t memory() const override { return embree->bytes(); }

 private:
  void cast(const std::vector<Ray>& rays, const Buffer<Hit>& hits, RayQuery query, bool coherent) const {
    const EmbreeRays prepared(rays, coherent, query);
    std::vector<Hit> found(rays.size());
    Stopwatch watch;
    embree->trace(coherent ? EmbreeMode::kPacket16 : EmbreeMode::kSingle, prepared, found);
    seconds += watch.lap();
    for (Hit& hit : found) {
      const Vec3f n = normalized(Vec3f{hit.normal[0], hit.normal[1], hit.normal[2]});
      for (int axis = 0; axis < 3; ++axis) hit.normal[axis] = n[axis];
    }
    Buffer<Hit> shared = hits;  // copies share their content
    shared.write(std::span<const Hit>(found));
  }
};

struct Options {
  std::vector<std::string> scans;
  std::uint32_t resolution = 512;
  int samples = 16, truth = 1024;
};

/// Over the pixels that either covers, sRGB apart: of light.
double rms(const Image& a, const Image& b) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < a.pixels.size(); i += 4) {
    if (a.pixels[i + 3] == 0 && b.pixels[i + 3] == 0) continue;
    for (std::size_t c = i; c < i + 3; ++c) {
      const double d = static_cast<double>(a.pixels[c] - b.pixels[c]);
      sum += d * d;
    }
    count += 3;
  }
  return std::sqrt(sum / std::max(1., count));
}

class LightBench {
 public:
  LightBench(const Device& device, const Options& options, const std::string& path)
      : options_(options), scan_(load_asset(path)) {
    const Vec3f lo = scan_.bounds.lo, hi = scan_.bounds.hi;
    camera_ = place_camera({}, {static_cast<Vec3d>(lo), static_cast<Vec3d>(hi)}, scan_.up_axis(), 1);
    std::printf("\n%s: %zu primitives, %u^2 pixels, %d paths each, studio light\n", scan_.name.c_str(),
                scan_.is_cloud ? scan_.scan()->positions.size() : scan_.scan()->triangles.size(),
                options.resolution, options.samples);
    std::printf(
        "| primary, secondary | seconds | casting | Mrays/s of it | rms to the exact scan's |\n"
        "| --- | --- | --- | --- | --- |\n");
    const auto exact = make_tracer(device, scan_);
    truth_ = picture(*exact, *exact, 0, options.truth).color;
    measure("exact", *exact, *exact, 0);
    const Asset pair = build_pair(device, *scan_.scan());
    std::vector<std::unique_ptr<Tracer>> levels;
    const std::vector<std::string> names = level_names(pair);
    for (const std::string& name : names) {
      TracerConfig config;
      config.level = name;
      levels.push_back(make_tracer(device, pair, config));
    }
    for (std::size_t i = 0; i < names.size(); ++i)
      measure(names[0] + ", " + names[i], *levels[0], *levels[i], path_offset(pair, names[0], names[i]));
    if (scan_.is_cloud || embree_version().empty()) return;
    const EmbreeTracer embree(device, *scan_.scan());
    measure("Embree " + embree_version(), embree, embree, 0, &embree.seconds);
  }

 private:
  PathPicture picture(const Tracer& primary, const Tracer& secondary, float offset, int samples) const {
    PathConfig config;
    config.width = config.height = options_.resolution;
    config.samples = samples;
    config.seed = samples == options_.truth ? 99 : 1;
    config.offset = offset;
    return trace_paths(primary, secondary, camera_, studio_environment(camera_), config);
  }

  void measure(const std::string& name, const Tracer& primary, const Tracer& secondary, float offset,
               const double* casting = nullptr) const {
    const double before = casting != nullptr ? *casting : 0;
    const PathPicture p = picture(primary, secondary, offset, options_.samples);
    const double cast = casting != nullptr ? *casting - before : p.trace_seconds;
    std::printf("| %s | %.2f | %.2f | %.2f | %.4f |\n", name.c_str(), cast + p.shade_seconds, cast,
                static_cast<double>(p.rays) / cast * 1e-6, rms(p.color, truth_));
    std::fflush(stdout);
  }

  const Options& options_;
  Asset scan_;
  Camera camera_;
  Image truth_;
};

}  // namespace
}  // namespace rbvh::bench

int main(int argc, char** argv) {
  using namespace rbvh;
  CLI::App app("Measures pictures by paths");
  bench::Options options;
  app.add_option("SCAN", options.scans, "scans, ingested")->required();
  app.add_option("--resolution", options.resolution, "pixels a side");
  app.add_option("--samples", options.samples, "paths a pixel");
  app.add_option("--truth", options.truth, "paths a pixel of the picture that others are compared with");
  CLI11_PARSE(app, argc, argv);
  try {
    const Device device = Device::open();
    for (const std::string& scan : options.scans) bench::LightBench(device, options, scan);
  } catch (const Error& error) {
    std::fprintf(stderr, "light_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}
