// The text of every file in kernels/, compiled into the library (cmake/EmbedKernels.cmake).
#pragma once

#include <cstddef>

namespace rbvh {

struct EmbeddedKernel {
  const char* name;  ///< "trace/trace_tile.cl"
  const char* text;
};
extern const EmbeddedKernel kEmbeddedKernels[];
extern const std::size_t kEmbeddedKernelCount;

}  // namespace rbvh
