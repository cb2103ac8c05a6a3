// Embree 3 behind plain types, in every way that is measured. Without Embree (RBVH_WITH_EMBREE undefined)
// there is nothing to choose from and embree_variants() is empty.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "kernels/common/layout.h"
#include "pipeline/trace/trace_tile.h"
#include "rbvh/scan.h"

namespace rbvh::bench {

enum class EmbreeMode { kSingle, kPacket16, kStream };

/// How a scene is built.
struct EmbreeBuild {
  std::string name;           ///< "default MEDIUM"
  std::string device_config;  ///< rtcNewDevice's words, beside the threads
  bool high_quality = false;
};

struct EmbreeVariant {
  std::string name;
  EmbreeMode mode;
};

std::vector<EmbreeBuild> embree_builds();
std::vector<EmbreeVariant> embree_variants();
std::string embree_version();  ///< empty without Embree

/// Rays in the layout of each mode, made outside the measured time.
class EmbreeRays {
 public:
  /// kAny: whether a ray is occluded up to its tmax, in every mode but kStream; kNearest: tmax is no limit.
  EmbreeRays(const std::vector<Ray>& rays, bool coherent, RayQuery query = RayQuery::kNearest);
  std::size_t size() const { return rays_.size(); }

 private:
  friend class EmbreeScene;
  struct alignas(64) Block {  ///< 16 rays by component; the last block repeats the last ray
    float ox[16], oy[16], oz[16], dx[16], dy[16], dz[16], tfar[16];
  };
  std::vector<Ray> rays_;
  std::vector<Block> blocks_;
  bool coherent_;
  RayQuery query_;
};

class EmbreeScene {
 public:
  /// Throws Error(kFailure) with Embree's message.
  EmbreeScene(const Scan& scan, const EmbreeBuild& build, int threads);
  ~EmbreeScene();
  EmbreeScene(EmbreeScene&&) noexcept;
  EmbreeScene& operator=(EmbreeScene&&) = delete;

  double build_seconds() const;  ///< of rtcCommitScene: hierarchy and its own copy of the primitives
  std::size_t bytes() const;     ///< what Embree holds for it, by its own count

  /// Nearest hits by `thread_count()` threads; the normals are Embree's, not of unit length. Of an
  /// occluded ray only that it hits.
  void trace(EmbreeMode mode, const EmbreeRays& rays, std::vector<Hit>& hits) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace rbvh::bench
