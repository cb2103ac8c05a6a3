// The camera words of the command line, and cameras from a file.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "pipeline/base/words.h"
#include "rbvh/view.h"

namespace rbvh {

struct CameraOptions : CameraRequest {
  Resolution resolution;
  CameraWords given;         ///< of every camera
  std::string cameras_path;  ///< JSON; empty: none
};

void add_camera_options(CLI::App& stage, CameraOptions& options);

}  // namespace rbvh
