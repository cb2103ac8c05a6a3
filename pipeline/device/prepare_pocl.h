// What PoCL takes from the environment, before it is loaded, and what it leaves on disk. All of it is nothing
// to other implementations of OpenCL.
#pragma once

#include <string>

namespace rbvh::device_detail {

/// Tells PoCL its threads, which are the host's (parallel_for.h), and where it keeps kernels: in a folder of
/// the temporary one where its own (POCL_CACHE_DIR, else below XDG_CACHE_HOME or HOME) cannot be written.
/// Once; changes the environment, which no other thread may read meanwhile.
void prepare_pocl();

/// "they are kept in ...", for users.
std::string pocl_cache_in_words();

/// Removes what PoCL leaves in its cache for ever: an empty file whenever it starts, and temporary files of
/// processes that were killed.
void tidy_pocl_cache();

/// Why it could not compile here, or nothing: with too low a limit on the size of files LLVM ends the
/// process.
std::string pocl_obstacle();

}  // namespace rbvh::device_detail
