// What a file holds that rays can be cast at: a scan, a pair with its levels, a proxy, or a scene of these.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rbvh/geometry.h"
#include "rbvh/memory_budget.h"
#include "rbvh/progress.h"

#pragma GCC visibility push(default)
namespace rbvh {

struct AssetContent;  // the library's own
struct Rbvh;
struct Scan;
struct Scene;

/// Cheap to copy: copies share the content. Safe to read from several threads.
struct Asset {
  std::string path;  ///< empty where it was not read
  std::string name;  ///< without folders and extension
  Bounds3f bounds;
  bool is_cloud = false;
  std::shared_ptr<AssetContent> content;

  /// Which kind it is: one of these is not null. A proxy is a scene of one object.
  Rbvh* rbvh() const;  ///< a pair
  Scan* scan() const;
  Scene* scene() const;

  Vec3d up_axis() const;  ///< +Z for clouds, else +Y, unless a scene says otherwise
};

/// A scan in memory as an asset. A cloud needs normals and radii.
Asset make_asset(Scan&& scan, const std::string& name = {});

/// The names of a pair's levels, finest first; none for other assets.
std::vector<std::string> level_names(const Asset& asset);

struct LoadConfig {
  MemoryBudget memory{};
  /// Proxies become triangles, up to 2^tessellate micro-quads a side of a patch.
  std::optional<std::uint32_t> tessellate{};
  /// Of a pair, the levels to read: by name, or "all", or "auto", which is all; none: the finest. Not set:
  /// all.
  std::optional<std::vector<std::string>> levels{};
};

/// Reads a pair, a scan of any format ("-": from standard input), a proxy (an .obj beside its other files),
/// or a scene (.json) with all its objects. The file may be hostile. A cloud gets the normals and radii that
/// it lacks. Throws Error(kInput), Error(kUsage) for a level that is not there, and
/// Error(kBudget) before more memory is taken than allowed.
Asset load_asset(const std::string& path, const LoadConfig& config = {}, const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
