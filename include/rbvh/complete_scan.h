// A scan made in memory, with what every stage expects of one.
#pragma once

#include "rbvh/progress.h"
#include "rbvh/scan.h"

#pragma GCC visibility push(default)
namespace rbvh {

/// Gives a cloud the normals and radii that it lacks, as reading one from a file does. Throws Error(kInput)
/// for a scan without two different finite points, or with corners that are no vertices.
void complete_scan(Scan& scan, const Progress& progress = {});

}  // namespace rbvh
#pragma GCC visibility pop
