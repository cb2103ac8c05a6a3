#include "tests/bench/embree_scene.h"

#include <algorithm>
#include <limits>

#include "pipeline/base/error.h"

namespace rbvh::bench {

EmbreeRays::EmbreeRays(const std::vector<Ray>& rays, bool coherent, RayQuery query)
    : rays_(rays), blocks_((rays.size() + 15) / 16), coherent_(coherent), query_(query) {
  if (query == RayQuery::kNearest) {
    for (Ray& ray : rays_) ray.tmax = std::numeric_limits<float>::infinity();
  }
  for (std::size_t i = 0; i < blocks_.size() * 16; ++i) {
    const Ray& ray = rays_[std::min(i, rays_.size() - 1)];
    Block& block = blocks_[i / 16];
    block.ox[i % 16] = ray.origin[0];
    block.oy[i % 16] = ray.origin[1];
    block.oz[i % 16] = ray.origin[2];
    block.dx[i % 16] = ray.direction[0];
    block.dy[i % 16] = ray.direction[1];
    block.dz[i % 16] = ray.direction[2];
    block.tfar[i % 16] = ray.tmax;
  }
}

}  // namespace rbvh::bench

#ifdef RBVH_WITH_EMBREE

#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <atomic>
#include <chrono>
#include <cstring>

#include "pipeline/base/parallel_for.h"

namespace rbvh::bench {
namespace {

constexpr std::size_t kGrain = 4096;  // rays that a thread takes at a time
constexpr unsigned kStreamLength = 256;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Embree's own advice: without it denormals slow it down.
struct FlushDenormals {
  FlushDenormals() : before(_mm_getcsr()) {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(before); }
  unsigned before;
};

void fill(RTCRay& r, const Ray& ray) {
  r.org_x = ray.origin[0];
  r.org_y = ray.origin[1];
  r.org_z = ray.origin[2];
  r.tnear = 0;
  r.dir_x = ray.direction[0];
  r.dir_y = ray.direction[1];
  r.dir_z = ray.direction[2];
  r.time = 0;
  r.tfar = ray.tmax;
  r.mask = ~0u;
  r.id = 0;
  r.flags = 0;
}

void fill(RTCRay16& r, const float* tfar) {
  std::fill_n(r.tnear, 16, 0.0f);
  std::fill_n(r.time, 16, 0.0f);
  std::memcpy(r.tfar, tfar, sizeof r.tfar);
  std::fill_n(r.mask, 16, ~0u);
  std::fill_n(r.flags, 16, 0u);
}

void fill(RTCRayHit& r, const Ray& ray) {
  fill(r.ray, ray);
  r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
}

Hit hit_of(bool hit, float t, float nx, float ny, float nz, float u, float v, unsigned primitive) {
  if (!hit) return {kInfinity, {0, 0, 0}, 0, 0, RBVH_NO_LEAF, 0};
  return {t, {nx, ny, nz}, u, v, primitive, RBVH_HIT_ON_PRIMITIVE};
}

/// Embree marks an occluded ray by tfar = -inf.
Hit occlusion(float tfar) { return hit_of(tfar < 0, 0, 0, 0, 0, 0, 0, 0); }

Hit hit_of(const RTCRayHit& r) {
  return hit_of(r.hit.geomID != RTC_INVALID_GEOMETRY_ID, r.ray.tfar, r.hit.Ng_x, r.hit.Ng_y, r.hit.Ng_z,
                r.hit.u, r.hit.v, r.hit.primID);
}

void* new_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t stride,
                 std::size_t count) {
  return rtcSetNewGeometryBuffer(geometry, type, 0, format, stride, count);
}

void fill_triangles(RTCGeometry geometry, const Scan& scan) {
  auto* vertices = static_cast<float*>(
      new_buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, sizeof(Vec3f), scan.positions.size()));
  std::memcpy(vertices, scan.positions.data(), scan.positions.size() * sizeof(Vec3f));
  auto* indices =
      new_buffer(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, sizeof(Triangle), scan.triangles.size());
  std::memcpy(indices, scan.triangles.data(), scan.triangles.size() * sizeof(Triangle));
}

void fill_discs(RTCGeometry geometry, const Scan& scan) {
  auto* discs = static_cast<float*>(new_buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4,
                                               4 * sizeof(float), scan.positions.size()));
  auto* normals = static_cast<float*>(
      new_buffer(geometry, RTC_BUFFER_TYPE_NORMAL, RTC_FORMAT_FLOAT3, sizeof(Vec3f), scan.positions.size()));
  for (std::size_t i = 0; i < scan.positions.size(); ++i) {
    std::memcpy(discs + 4 * i, &scan.positions[i], sizeof(Vec3f));
    discs[4 * i + 3] = scan.radii[i];
    std::memcpy(normals + 3 * i, &scan.normals[i], sizeof(Vec3f));
  }
}

}  // namespace

std::vector<EmbreeBuild> embree_builds() {
  std::vector<EmbreeBuild> builds;
  for (const auto& [name, words] : {std::pair{"default", ""}, {"simd512", "frequency_level=simd512"}}) {
    builds.push_back({std::string(name) + " MEDIUM", words, false});
    builds.push_back({std::string(name) + " HIGH", words, true});
  }
  return builds;
}

std::vector<EmbreeVariant> embree_variants() {
  return {
      {"single", EmbreeMode::kSingle}, {"packet16", EmbreeMode::kPacket16}, {"stream", EmbreeMode::kStream}};
}

std::string embree_version() { return RTC_VERSION_STRING; }

struct EmbreeScene::State {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::atomic<std::ptrdiff_t> bytes{0};
  double build_seconds = 0;
  ~State() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

EmbreeScene::EmbreeScene(const Scan& scan, const EmbreeBuild& build, int threads)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  const std::string words =
      "threads=" + std::to_string(threads) + (build.device_config.empty() ? "" : "," + build.device_config);
  state.device = rtcNewDevice(words.c_str());
  if (state.device == nullptr)
    throw Error(ErrorKind::kFailure, {}, "Embree does not start with '" + words + "'");
  rtcSetDeviceMemoryMonitorFunction(
      state.device,
      [](void* at, ssize_t bytes, bool) {
        *static_cast<std::atomic<std::ptrdiff_t>*>(at) += bytes;
        return true;
      },
      &state.bytes);
  RTCGeometry geometry = rtcNewGeometry(
      state.device, scan.is_cloud() ? RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT : RTC_GEOMETRY_TYPE_TRIANGLE);
  scan.is_cloud() ? fill_discs(geometry, scan) : fill_triangles(geometry, scan);
  const RTCBuildQuality quality = build.high_quality ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM;
  rtcSetGeometryBuildQuality(geometry, quality);
  rtcCommitGeometry(geometry);
  state.scene = rtcNewScene(state.device);
  rtcSetSceneBuildQuality(state.scene, quality);
  rtcAttachGeometry(state.scene, geometry);
  rtcReleaseGeometry(geometry);
  const auto start = std::chrono::steady_clock::now();
  rtcCommitScene(state.scene);
  state.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (const RTCError error = rtcGetDeviceError(state.device); error != RTC_ERROR_NONE) {
    throw Error(ErrorKind::kFailure, {}, "Embree " + build.name + ": error " + std::to_string(error));
  }
}

EmbreeScene::~EmbreeScene() = default;
EmbreeScene::EmbreeScene(EmbreeScene&&) noexcept = default;

double EmbreeScene::build_seconds() const { return state_->build_seconds; }

std::size_t EmbreeScene::bytes() const {
  return static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, state_->bytes));
}

void EmbreeScene::trace(EmbreeMode mode, const EmbreeRays& rays, std::vector<Hit>& hits) const {
  RTCScene scene = state_->scene;
  hits.resize(rays.size());
  const auto new_context = [&] {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags =
        rays.coherent_ ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    return context;
  };
  const auto single = [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    RTCIntersectContext context = new_context();
    for (std::size_t i = begin; i < end; ++i) {
      if (rays.query_ == RayQuery::kAny) {
        RTCRay r;
        fill(r, rays.rays_[i]);
        rtcOccluded1(scene, &context, &r);
        hits[i] = occlusion(r.tfar);
        continue;
      }
      RTCRayHit r;
      fill(r, rays.rays_[i]);
      rtcIntersect1(scene, &context, &r);
      hits[i] = hit_of(r);
    }
  };
  const auto stream = [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    RTCIntersectContext context = new_context();
    RTCRayHit batch[kStreamLength];
    for (std::size_t i = begin; i < end; i += kStreamLength) {
      const auto count = static_cast<unsigned>(std::min<std::size_t>(kStreamLength, end - i));
      for (unsigned k = 0; k < count; ++k) fill(batch[k], rays.rays_[i + k]);
      rtcIntersect1M(scene, &context, batch, count, sizeof(RTCRayHit));
      for (unsigned k = 0; k < count; ++k) hits[i + k] = hit_of(batch[k]);
    }
  };
  const auto packet = [&](std::size_t begin, std::size_t end) {
    const FlushDenormals flush;
    RTCIntersectContext context = new_context();
    alignas(64) int valid[16];
    std::fill_n(valid, 16, -1);
    alignas(64) RTCRayHit16 p;
    for (std::size_t i = begin; i < end; i += 16) {
      const EmbreeRays::Block& block = rays.blocks_[i / 16];
      std::memcpy(p.ray.org_x, block.ox, sizeof block.ox);
      std::memcpy(p.ray.org_y, block.oy, sizeof block.oy);
      std::memcpy(p.ray.org_z, block.oz, sizeof block.oz);
      std::memcpy(p.ray.dir_x, block.dx, sizeof block.dx);
      std::memcpy(p.ray.dir_y, block.dy, sizeof block.dy);
      std::memcpy(p.ray.dir_z, block.dz, sizeof block.dz);
      fill(p.ray, block.tfar);
      const std::size_t count = std::min<std::size_t>(16, end - i);
      if (rays.query_ == RayQuery::kAny) {
        rtcOccluded16(valid, scene, &context, &p.ray);
        for (std::size_t k = 0; k < count; ++k) hits[i + k] = occlusion(p.ray.tfar[k]);
        continue;
      }
      std::fill_n(p.hit.geomID, 16, RTC_INVALID_GEOMETRY_ID);
      std::fill_n(p.hit.instID[0], 16, RTC_INVALID_GEOMETRY_ID);
      rtcIntersect16(valid, scene, &context, &p);
      for (std::size_t k = 0; k < count; ++k) {
        hits[i + k] = hit_of(p.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID, p.ray.tfar[k], p.hit.Ng_x[k],
                             p.hit.Ng_y[k], p.hit.Ng_z[k], p.hit.u[k], p.hit.v[k], p.hit.primID[k]);
      }
    }
  };
  switch (mode) {
    case EmbreeMode::kSingle:
      return parallel_for(rays.size(), kGrain, single);
    case EmbreeMode::kPacket16:
      return parallel_for(rays.size(), kGrain, packet);
    case EmbreeMode::kStream:
      return parallel_for(rays.size(), kGrain, stream);
  }
}

}  // namespace rbvh::bench

#else

namespace rbvh::bench {

struct EmbreeScene::State {};
std::vector<EmbreeBuild> embree_builds() { return {}; }
std::vector<EmbreeVariant> embree_variants() { return {}; }
std::string embree_version() { return {}; }
EmbreeScene::EmbreeScene(const Scan&, const EmbreeBuild&, int) {
  throw Error(ErrorKind::kFailure, {}, "built without Embree");
}
EmbreeScene::~EmbreeScene() = default;
EmbreeScene::EmbreeScene(EmbreeScene&&) noexcept = default;
double EmbreeScene::build_seconds() const { return 0; }
std::size_t EmbreeScene::bytes() const { return 0; }
void EmbreeScene::trace(EmbreeMode, const EmbreeRays&, std::vector<Hit>&) const {}

}  // namespace rbvh::bench

#endif
