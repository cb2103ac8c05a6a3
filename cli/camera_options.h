// The camera words of the command line, and cameras from a file.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/words.h"
#include "rbvh/camera.h"

namespace rbvh {

struct CameraOptions {
  Resolution resolution;
  CameraWords words;
  std::optional<Vec3d> up;   ///< axis; else +Y for meshes, +Z for clouds
  int turntable = 0;         ///< cameras; 0: not asked for
  std::string cameras_path;  ///< JSON; empty: none
};

void add_camera_options(CLI::App& stage, CameraOptions& options);

}  // namespace rbvh
