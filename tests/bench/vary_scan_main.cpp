// Makes benchmark scans: `vary_scan dragon.ply --loop 2 --noise 0.2 -o fine.ply`, `vary_scan dragon.ply
// --points 400000 -o cloud.ply`.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "io/scan_io.h"
#include "pipeline/base/error.h"
#include "pipeline/scan/radii.h"
#include "tests/bench/vary_scan.h"

int main(int argc, char** argv) {
  std::string in, out;
  int steps = 0;
  double noise = 0;
  std::size_t points = 0;
  std::uint64_t seed = 1;
  bool keeps_normals = false;
  CLI::App app("Makes finer meshes, noisy ones and clouds of a mesh; the same bytes every time");
  app.add_option("MESH", in, "a mesh of any format that ingest reads")->required();
  app.add_option("-o,--output", out, "PLY to write")->required();
  app.add_option("--loop", steps, "steps of Loop's subdivision, each four times the triangles")
      ->check(CLI::Range(0, 6));
  app.add_option("--points", points, "a cloud of so many points, evenly spread by area, in the mesh's place");
  app.add_option("--noise", noise,
                 "Gaussian along the normals; in mean edges of the input (of a cloud: in its mean spacings)");
  app.add_option("--seed", seed, "of noise and points")->capture_default_str();
  app.add_flag("--normals", keeps_normals, "the cloud knows its triangles' normals");
  CLI11_PARSE(app, argc, argv);
  try {
    rbvh::Scan scan = rbvh::shift_to_float(rbvh::read_scan(in));
    if (scan.is_cloud()) throw rbvh::Error(rbvh::ErrorKind::kInput, in, "is a cloud; a mesh is wanted");
    double unit = rbvh::mean_edge(scan);
    for (int i = 0; i < steps; ++i) scan = rbvh::loop_subdivided(scan);
    if (points > 0) {
      unit = std::sqrt(rbvh::surface_area(scan) / static_cast<double>(points));
      scan = rbvh::sample_points(scan, points, seed);
    }
    if (noise > 0) rbvh::add_noise(scan, noise * unit, seed + 1);
    if (!keeps_normals) scan.normals.clear();
    rbvh::write_ply(out, scan, true);
    std::fprintf(stderr, "vary_scan: %zu vertices, %zu triangles; noise %.4g, 1 = %.6g\n",
                 scan.positions.size(), scan.triangles.size(), noise, unit);
  } catch (const rbvh::Error& error) {
    std::fprintf(stderr, "vary_scan: %s\n", error.what());
    return 1;
  }
  return 0;
}
