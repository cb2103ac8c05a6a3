// rbvh_demo_scan: a simulated scanner. Looks at the demo's sculpture from thirty places and writes what
// it saw, fused into a mesh (PLY) and as raw points (PCD), with the noise, outliers, holes and grazing
// drop-outs of a real scan.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "cli/exit_code.h"
#include "demo_shape.h"
#include "fuse.h"
#include "io/interrupts.h"
#include "io/output_file.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "range_camera.h"

namespace rbvh::demo {
namespace {

struct Options {
  std::string mesh, clouds;
  std::uint64_t triangles = 900000, points = 500000;
  std::uint64_t seed = 1;
  double noise = 2e-4;  // of the diagonal
  int threads = 0;
  bool force = false;
};

/// Triangles of the fused mesh times its cell size squared: measured, it hardly depends on the cell size.
constexpr double kTriangleArea = 90;

std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255 + 0.5f);
}

template <class T>
void append(std::vector<std::byte>& bytes, const T& value) {
  const auto* from = reinterpret_cast<const std::byte*>(&value);
  bytes.insert(bytes.end(), from, from + sizeof(T));
}

void append_text(std::vector<std::byte>& bytes, const std::string& text) {
  const auto* from = reinterpret_cast<const std::byte*>(text.data());
  bytes.insert(bytes.end(), from, from + text.size());
}

void write_mesh(const DemoShape& shape, const FusedMesh& mesh, const Options& options) {
  std::vector<Vec3f> colors(mesh.positions.size());
  parallel_for(colors.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) colors[i] = shape.sample(mesh.positions[i]).color;
  });
  std::vector<std::byte> bytes;
  bytes.reserve(400 + mesh.positions.size() * 15 + mesh.triangles.size() * 13);
  append_text(bytes, "ply\nformat binary_little_endian 1.0\ncomment made by rbvh_demo_scan\nelement vertex " +
                         std::to_string(mesh.positions.size()) +
                         "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                         "property uchar green\nproperty uchar blue\nelement face " +
                         std::to_string(mesh.triangles.size()) +
                         "\nproperty list uchar int vertex_indices\nend_header\n");
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    append(bytes, mesh.positions[i]);
    for (int c = 0; c < 3; ++c) append(bytes, to_byte(colors[i][c]));
  }
  for (const auto& triangle : mesh.triangles) {
    append(bytes, std::uint8_t{3});
    append(bytes, triangle);
  }
  OutputFile file(options.mesh, options.force);
  file.write(bytes);
  file.commit();
  std::fprintf(stderr, "%s: %zu triangles, %zu vertices\n", options.mesh.c_str(), mesh.triangles.size(),
               mesh.positions.size());
}

std::string cloud_name(const Options& options, std::size_t view) {
  return options.clouds + (view < 9 ? "0" : "") + std::to_string(view + 1) + ".pcd";
}

/// One place's points as measured, thinned to `share`, its VIEWPOINT where the tripod stood.
std::size_t write_cloud(const DemoShape& shape, const RangeImage& image, std::size_t view, double share,
                        const Options& options) {
  struct Point {
    Vec3f position;
    std::uint32_t color;
  };
  std::vector<Point> points;
  const auto width = static_cast<std::size_t>(image.width);
  for (std::size_t i = 0; i < image.ranges.size(); ++i) {
    if (image.ranges[i] == 0 || random_unit(options.seed, view, i) >= share) continue;
    const std::size_t row = i / width, column = i % width;
    const Vec3f direction = image.direction(static_cast<float>(column), static_cast<float>(row));
    points.push_back({image.eye + direction * image.ranges[i], 0});
  }
  parallel_for(points.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f color = shape.sample(points[i].position).color;
      points[i].color = static_cast<std::uint32_t>(to_byte(color.x)) << 16 |
                        static_cast<std::uint32_t>(to_byte(color.y)) << 8 | to_byte(color.z);
    }
  });
  const std::string count = std::to_string(points.size());
  char viewpoint[100];
  std::snprintf(viewpoint, sizeof viewpoint, "%.6f %.6f %.6f 1 0 0 0", static_cast<double>(image.eye.x),
                static_cast<double>(image.eye.y), static_cast<double>(image.eye.z));
  std::vector<std::byte> bytes;
  append_text(bytes,
              "# .PCD v0.7 - made by rbvh_demo_scan\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\n"
              "TYPE F F F U\nCOUNT 1 1 1 1\nWIDTH " +
                  count + "\nHEIGHT 1\nVIEWPOINT " + viewpoint + "\nPOINTS " + count + "\nDATA binary\n");
  for (const Point& point : points) append(bytes, point);
  OutputFile file(cloud_name(options, view), options.force);
  file.write(bytes);
  file.commit();
  return points.size();
}

void write_clouds(const DemoShape& shape, const std::vector<RangeImage>& images, const Options& options) {
  std::size_t measured = 0, written = 0;
  for (const RangeImage& image : images)
    for (const float range : image.ranges) measured += range != 0;
  const double share =
      static_cast<double>(options.points) / static_cast<double>(std::max<std::size_t>(1, measured));
  for (std::size_t view = 0; view < images.size(); ++view)
    written += write_cloud(shape, images[view], view, share, options);
  std::fprintf(stderr, "%s .. %s: %zu points\n", cloud_name(options, 0).c_str(),
               cloud_name(options, images.size() - 1).c_str(), written);
}

void run(const Options& options) {
  set_thread_count(options.threads);
  const DemoShape shape;
  const std::vector<Vec3f> places = tripod_places(shape);
  if (!options.mesh.empty()) check_output(options.mesh, options.force);
  for (std::size_t view = 0; !options.clouds.empty() && view < places.size(); ++view)
    check_output(cloud_name(options, view), options.force);
  const float diagonal = shape.bounds().diagonal();
  const auto cell = static_cast<float>(std::sqrt(kTriangleArea / static_cast<double>(options.triangles)));
  RangeCameraConfig camera;
  camera.noise = static_cast<float>(options.noise) * diagonal;
  camera.registration = 0.5f * camera.noise;
  camera.seed = options.seed;
  camera.width = static_cast<int>(1.1f * diagonal / cell);  // pixels a little finer than the mesh will be
  std::vector<RangeImage> images;
  for (const Vec3f eye : tripod_places(shape))
    images.push_back(take_range_image(shape, eye, images.size(), camera));
  if (!options.mesh.empty()) write_mesh(shape, fuse_range_images(images, cell), options);
  if (!options.clouds.empty()) write_clouds(shape, images, options);
}

}  // namespace
}  // namespace rbvh::demo

int main(int argc, char** argv) {
  rbvh::demo::Options options;
  CLI::App app("Scans a sculpture that exists only as a formula, with a scanner's faults.");
  app.add_option("-o,--mesh", options.mesh, "fused mesh to write (PLY)");
  app.add_option("--clouds", options.clouds,
                 "points to write, one PCD a viewpoint: PREFIX01.pcd and so on; coloured, without normals");
  app.add_option("--triangles", options.triangles, "of the mesh, about")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1000}, std::uint64_t{50000000}));
  app.add_option("--points", options.points, "of all clouds together, about")->capture_default_str();
  app.add_option("--noise", options.noise, "standard deviation along the ray, as a fraction of the diagonal")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 0.01));
  app.add_option("--seed", options.seed, "another seed, another noise")->capture_default_str();
  app.add_option("--threads", options.threads, "0: all")->check(CLI::NonNegativeNumber);
  app.add_flag("-f,--force", options.force, "replace what is there");
  try {
    app.parse(argc, argv);
    if (options.mesh.empty() && options.clouds.empty()) throw CLI::RequiredError("--mesh or --clouds");
    rbvh::install_interrupt_cleanup();
    rbvh::demo::run(options);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "rbvh_demo_scan: %s\n", error.what());
    return static_cast<int>(rbvh::ExitCode::kUsage);
  } catch (const rbvh::Error& error) {
    const char* const remedy =
        error.remedy() == rbvh::Remedy::kOverwrite ? "; use --force to replace it" : "";
    std::fprintf(stderr, "rbvh_demo_scan: %s%s\n", error.what(), remedy);
    return static_cast<int>(rbvh::exit_code(error.kind()));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rbvh_demo_scan: %s\n", error.what());
    return static_cast<int>(rbvh::ExitCode::kFailure);
  }
  return 0;
}
