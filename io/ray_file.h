// Rays of a .npy file, cast, and what they hit as another such file.
#pragma once

#include <string>

#include "io/npy.h"
#include "pipeline/trace/ray_table.h"
#include "rbvh/asset.h"

namespace rbvh {

/// N x 6 or N x 8 float32 or float64: origin, direction, [tmin, tmax] ("-": standard input). Throws as
/// read_npy() does.
NpyReader open_rays(const std::string& path);

/// The step of float32 rays, scan units, where their origins are so large (`shift`, what the asset's are to
/// be moved by) that it is too coarse for the asset; else, and of float64, 0.
double coarse_step(const NpyReader& rays, const Asset& asset, Vec3d shift);

/// Casts all rays, less `shift` in their origins, and writes N x kHitColumns to `output` ("-": standard
/// output): see hit_rows(). Throws as the reader, and Error(kFailure).
RayTableCounts cast_ray_file(const Tracer& tracer, NpyReader& rays, Vec3d shift, RayQuery query,
                             const std::string& output, bool overwrite, const Progress& progress = {});

}  // namespace rbvh
