// scene.json (docs/scene.md): the files of a scene and their placement; the files are not opened.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/base/affine.h"

namespace rbvh {

struct SceneFile {
  struct Object {
    std::string name;   ///< in the scene
    std::string path;   ///< as it can be opened from here
    std::string level;  ///< of a pair; empty: the finest
  };
  struct Instance {
    std::size_t object = 0;
    Affine to_world;
  };
  std::vector<Object> objects;  ///< those that are files, in the order of their names
  std::vector<Instance> instances;
  bool z_is_up = false;
};

/// More in a scene are an error.
inline constexpr std::size_t kMostSceneInstances = 1000000;

/// True for a path that ends in .json: no other input does.
bool is_scene(const std::string& path);

/// Reads a scene; its paths are relative to its folder. Groups are expanded. Hostile input is expected.
/// Throws Error(kInput) naming the first fault: what is no JSON, unknown or doubled words, references that
/// are missing or lead back to themselves, transforms that are singular or not finite, too many instances.
SceneFile read_scene(const std::string& path);

/// The same of bytes in memory; `path` is for messages and for relative paths.
SceneFile decode_scene(std::string_view text, const std::string& path);

}  // namespace rbvh
