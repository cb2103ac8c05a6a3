// The text of a kernel file, ready for the OpenCL compiler: OpenCL has no portable include path for text in
// memory, so `#include "kernels/..."` lines are expanded here, with #line directives that keep build logs
// pointing to the right file.
#pragma once

#include <string>
#include <string_view>

namespace rbvh {

/// kernels/<name>, such as "trace/trace_tile.cl", with its includes expanded. Looked up in the folder named
/// by the environment's RBVH_KERNELS first, then in the embedded table. Throws Error(kDevice) naming the file
/// that is missing and who includes it.
std::string kernel_source(std::string_view name);

}  // namespace rbvh
