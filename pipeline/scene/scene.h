// A scene of several objects: scans, levels of file pairs, and proxies, placed by instances.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "pipeline/base/affine.h"
#include "pipeline/proxy/proxy.h"
#include "pipeline/rbvh/rbvh.h"
#include "rbvh/scan.h"

namespace rbvh {

/// A level that is read when it is wanted.
struct LevelOnDemand {
  std::uint32_t leaves = 0;
  std::uint64_t bytes = 0;  ///< about, in memory and on the device
  std::function<Level()> load;
};

struct SceneObject {
  std::string name;
  std::variant<Scan, Level, Proxy, LevelOnDemand> content;  ///< a cloud has normals and radii
  Bounds3f bounds;                                          ///< in its own space
  Vec3d shift{};                                            ///< its file's coordinates are its own + shift
  const Scan* scan() const { return std::get_if<Scan>(&content); }
  const Level* level() const { return std::get_if<Level>(&content); }
  const Proxy* proxy() const { return std::get_if<Proxy>(&content); }
  const LevelOnDemand* on_demand() const { return std::get_if<LevelOnDemand>(&content); }
};

struct SceneInstance {
  std::uint32_t object = 0;
  Affine to_world;  ///< invertible
};

struct Scene {
  std::vector<SceneObject> objects;
  std::vector<SceneInstance> instances;
  bool z_is_up = false;
  Vec3d shift{};  ///< the coordinates that the scene states are these + shift
  /// Of a pair of parts: the level whose parts the objects are, and how many bytes of them are there at once.
  std::string level;
  std::uint64_t resident_bytes = 0;
};

/// Chooses the frame common to all objects and moves the instances, which the scene states for their files'
/// coordinates, into it. Where no object is shifted, nothing is.
void choose_frame(Scene& scene);

/// Primitives, tiles or patches.
std::size_t leaf_count(const SceneObject& object);

/// Where each instance's leaves start among all, and their number at the end. Throws Error(kBudget) beyond
/// 2^32.
std::vector<std::uint32_t> first_leaves(const Scene& scene);

/// The box around all instances.
Bounds3f bounds(const Scene& scene);

}  // namespace rbvh
