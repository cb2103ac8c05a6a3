#include "pipeline/trace/trace_exact.h"

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/base/error.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/bvh/build_exact.h"
#include "pipeline/bvh/flatten_bvh.h"
#include "pipeline/bvh/flatten_kd.h"
#include "pipeline/bvh/kd_tree.h"
#include "pipeline/bvh/leaf_blocks.h"
#include "pipeline/bvh/primitive_bounds.h"
#include "pipeline/bvh/wide_bvh.h"
#include "pipeline/trace/surface.h"

namespace rbvh {
namespace {

constexpr std::size_t kGroup = 64, kPacketGroup = 16;
constexpr std::size_t kBeamGroup = 4;
constexpr std::uint32_t kLeafSize = 8;
// Triangles a pixel up to which beams pay: where they are smaller, the rays of a beam go apart. Measured with
// packets alone: 4.5 times as fast as single rays at 0.2 triangles, 2.7 at 0.8, 1.7 at 3.3, 0.8 at 13.
constexpr std::size_t kBeamTriangles = 8;

/// Device structs as the words they are made of.
template <class T>
Buffer<std::uint32_t> upload(const Device& device, const std::vector<T>& values) {
  static_assert(sizeof(T) % sizeof(std::uint32_t) == 0);
  return {device, std::span(reinterpret_cast<const std::uint32_t*>(values.data()),
                            values.size() * sizeof(T) / sizeof(std::uint32_t))};
}

/// A kernel's array of at least `entries`: few sizes, as each is a kernel of its own.
std::string stack_option(std::uint32_t entries, std::uint32_t step) {
  return "-DSTACK=" + std::to_string((entries + step - 1) / step * step);
}

/// Uploads any layout, once it is there.
template <class Layout, class Primitives>
void upload_layout(ExactTracer& tracer, const Layout& layout, const Primitives& primitives, Stopwatch& watch,
                   ExactTimings& times) {
  times.flatten = watch.lap();
  tracer.scene = layout.scene;
  tracer.nodes = upload(tracer.device, layout.nodes);
  tracer.primitives = upload(tracer.device, primitives);
  times.upload = watch.lap();
}

void make_from_bvh(ExactTracer& tracer, const Scan& scan, const ExactConfig& config, ExactTimings* timings) {
  ExactTimings unasked;
  ExactTimings& times = timings != nullptr ? *timings : unasked;
  Stopwatch watch;
  const bool wide = config.traversal == ExactTraversal::kWide16;
  const BvhConfig bvh_config = wide ? kLeafBlockConfig : BvhConfig{.leaf_size = kLeafSize};
  Bvh bvh = build_bvh(tracer.device, config.builder, primitive_bounds(scan), bvh_config);
  times.hierarchy = watch.lap();
  if (timings != nullptr) times.sah_cost = sah_cost(bvh, bvh_config);
  watch.lap();
  switch (config.traversal) {
    case ExactTraversal::kWide16: {
      if (!scan.is_cloud()) split_for_clusters(scan, bvh);
      std::vector<std::uint32_t> leaves;
      const WideBvh layout = widen(bvh, leaves);
      tracer.options = stack_option(layout.stack, 128) + (scan.is_cloud() ? " -DDISCS" : "");
      // A GPU's work-items have no room for 16 rays.
      if (tracer.device.info().is_cpu)
        tracer.beam_pixels =
            (scan.is_cloud() ? scan.positions.size() : scan.triangles.size()) / kBeamTriangles + 1;
      return scan.is_cloud()
                 ? upload_layout(tracer, layout, make_disc_blocks(bvh, leaves, scan), watch, times)
                 : upload_layout(tracer, layout, make_clusters(bvh, leaves, scan), watch, times);
    }
    case ExactTraversal::kBvhStack:
    case ExactTraversal::kBvhTrail: {
      const PairLayout layout = flatten_bvh_pairs(bvh, scan);
      const int levels = depth(bvh);
      tracer.options = config.traversal == ExactTraversal::kBvhStack
                           ? stack_option(static_cast<std::uint32_t>(levels), 48)
                           : std::string("-DTRAIL_WORDS=") + (levels <= 64 ? "1" : "2");
      return upload_layout(tracer, layout, layout.triangles, watch, times);
    }
    case ExactTraversal::kBvhParent: {
      const ParentLayout layout = flatten_bvh_parents(bvh, scan);
      return upload_layout(tracer, layout, layout.triangles, watch, times);
    }
    default:
      check_failed("a traversal of binary hierarchies", __FILE__, __LINE__);
  }
}

void make_from_kd(ExactTracer& tracer, const Scan& scan, const ExactConfig& config, ExactTimings* timings) {
  ExactTimings unasked;
  ExactTimings& times = timings != nullptr ? *timings : unasked;
  Stopwatch watch;
  const bool backtrack = config.traversal == ExactTraversal::kKdBacktrack;
  KdConfig kd_config;
  kd_config.flat_cells = !backtrack;
  const KdTree tree = build_kd_tree(primitive_bounds(scan), kd_config);
  times.hierarchy = watch.lap();
  if (timings != nullptr) times.sah_cost = sah_cost(tree, kd_config);
  watch.lap();
  if (backtrack) {
    const KdLayout<KdCellNode> layout = flatten_kd_cells(tree, scan);
    tracer.references = upload(tracer.device, layout.references);
    return upload_layout(tracer, layout, layout.triangles, watch, times);
  }
  const KdLayout<KdCutNode> layout = flatten_kd_cuts(tree, scan);
  if (config.traversal == ExactTraversal::kKdStack) tracer.options = stack_option(kMaxKdDepth, 64);
  tracer.references = upload(tracer.device, layout.references);
  upload_layout(tracer, layout, layout.triangles, watch, times);
}

}  // namespace

ExactTracer make_exact_tracer(const Device& device, const Scan& scan, const ExactConfig& config,
                              ExactTimings* timings) {
  RBVH_CHECK(!scan.is_cloud() ||
             (scan.normals.size() == scan.positions.size() && scan.radii.size() == scan.positions.size()));
  const ExactTraversalInfo& traversal = info(config.traversal);
  RBVH_CHECK(traversal.tree == info(config.builder).tree);
  if (scan.is_cloud() && !scan.positions.empty() && !traversal.discs) {
    throw Error(ErrorKind::kUsage, {},
                std::string(traversal.name) + " casts triangles only, and this is a cloud; take " +
                    kExactTraversals[0].name);
  }
  ExactTracer tracer(device);
  tracer.kernel = traversal.kernel;
  tracer.scan = &scan;
  if (traversal.tree == TreeKind::kKd) {
    make_from_kd(tracer, scan, config, timings);
  } else {
    make_from_bvh(tracer, scan, config, timings);
  }
  return tracer;
}

void ExactTracer::intersect(const Buffer<Ray>& rays, const Buffer<Hit>& hits, std::size_t count,
                            RayQuery query, const Buffer<std::uint32_t>* steps) const {
  RBVH_CHECK(rays.size() >= count && hits.size() >= count && (steps == nullptr || steps->size() >= count));
  const std::uint32_t any = query == RayQuery::kAny ? 1 : 0;
  const bool in_groups = beam_pixels > 0;
  device.kernel(kernel, in_groups ? "trace_ray_groups" : "trace_rays", options)
      .run(in_groups ? (count + 15) / 16 : count, in_groups ? kPacketGroup : kGroup, nodes, primitives,
           references, scene, rays, static_cast<std::uint32_t>(count), any, hits,
           steps != nullptr ? *steps : Buffer<std::uint32_t>());
}

void ExactTracer::intersect(const CameraRays& camera, const Buffer<Hit>& hits,
                            const Buffer<std::uint32_t>* steps) const {
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  RBVH_CHECK(hits.size() >= pixels && (steps == nullptr || steps->size() >= pixels));
  const auto squares = [](std::uint32_t count, std::uint32_t side) { return (count + side - 1) / side; };
  if (beam_pixels > 0) {
    const bool in_beams = pixels >= beam_pixels;
    const std::uint32_t side = in_beams ? 8 : 4, in_row = squares(camera.width, side);
    device.kernel(kernel, in_beams ? "trace_camera_beams" : "trace_camera_groups", options)
        .run(std::size_t{in_row} * squares(camera.height, side), in_beams ? kBeamGroup : kPacketGroup, nodes,
             primitives, references, scene, camera, in_row, hits,
             steps != nullptr ? *steps : Buffer<std::uint32_t>());
    return;
  }
  device.kernel(kernel, "trace_camera", options)
      .run(std::size_t{squares(camera.width, 8)} * squares(camera.height, 8) * 64, kGroup, nodes, primitives,
           references, scene, camera, hits, steps != nullptr ? *steps : Buffer<std::uint32_t>());
}

SurfaceSamples ExactTracer::surface(std::span<const Hit> hits, float spread) const {
  if (scan->is_cloud()) {
    if (!discs) discs = std::make_shared<const DiscSurface>(make_disc_surface(*scan));
    return sample_surface(*scan, *discs, hits);
  }
  if (!normals) normals = std::make_shared<const ShadingNormals>(shading_normals(*scan));
  if (!textures) textures = std::make_shared<const TextureSampler>(*scan);
  return sample_surface(*scan, *normals, *textures, hits, spread);
}

ExactVisits mean_visits(const ExactTracer& tracer, const Buffer<Ray>& rays, std::size_t count,
                        RayQuery query) {
  RBVH_CHECK(rays.size() >= count);
  const Buffer<std::uint32_t> visits(tracer.device, 2 * count);
  const std::uint32_t any = query == RayQuery::kAny ? 1 : 0;
  tracer.device.kernel(tracer.kernel, "trace_visits", tracer.options)
      .run(count, kGroup, tracer.nodes, tracer.primitives, tracer.references, tracer.scene, rays,
           static_cast<std::uint32_t>(count), any, visits);
  ExactVisits mean;
  const std::vector<std::uint32_t> each = visits.read();
  for (std::size_t i = 0; i < each.size(); i += 2) {
    mean.nodes += each[i];
    mean.primitives += each[i + 1];
  }
  mean.nodes /= static_cast<double>(std::max<std::size_t>(1, count));
  mean.primitives /= static_cast<double>(std::max<std::size_t>(1, count));
  return mean;
}

}  // namespace rbvh
