// What is timed, in rounds over all, on the same rays: tracers of ours, and Embree in each of its ways.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/device/device.h"
#include "rbvh/scan.h"
#include "rbvh/tracer.h"
#include "tests/bench/bench_report.h"
#include "tests/bench/embree_scene.h"

namespace rbvh::bench {

double seconds_of(const std::function<void()>& work);

/// "primary" rays are a camera's that sees the whole scan, "diffuse" ones a bounce from what these hit.
struct TimedRays {
  CameraRays words{};
  std::vector<Ray> primary, diffuse;
  Buffer<Ray> diffuse_buffer;
  Buffer<Hit> hits;

  const std::vector<Ray>& of(const std::string& kind) const { return kind == "primary" ? primary : diffuse; }
};

/// Diffuse rays start `bounce_offset` diagonals off the surface.
TimedRays make_timed_rays(const Device& device, const Tracer& exact, const Scan& scan,
                          std::uint32_t resolution, double bounce_offset);

/// Casts the rays of one kind, and waits for the device.
void trace(const Tracer& tracer, const std::string& kind, const TimedRays& rays);

/// Something that casts the rays of one kind, and its result.
struct Contender {
  RaysResult result;
  std::function<void()> trace;
  std::function<std::size_t()> count_hits;
};

/// What it is given must outlive it.
Contender device_contender(const std::string& kind, const std::string& engine, const std::string& name,
                           const Tracer& tracer, const TimedRays& rays);

/// A contender for each scene and each of embree_variants(); `scenes` as embree_builds(), or none.
std::vector<Contender> embree_contenders(const std::string& kind, const std::vector<EmbreeScene>& scenes,
                                         const TimedRays& rays);

/// One unmeasured round, then rounds over all contenders, so that a slow phase of the machine slows all.
void run_interleaved(std::vector<Contender>& contenders, int repetitions, Report& report);

}  // namespace rbvh::bench
