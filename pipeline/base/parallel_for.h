// Runs body(begin, end) over disjoint pieces of [0, count) on host threads. The pieces depend on `count` and
// `grain` alone, so results cannot depend on the number of threads as long as the body writes only what
// belongs to its piece.
#pragma once

#include <cstddef>
#include <functional>

namespace rbvh {

/// Host threads used by parallel_for; 0 is the machine's own number.
void set_thread_count(int threads);
int thread_count();

/// The first exception thrown by a body is rethrown here after all threads have stopped.
void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body);

}  // namespace rbvh
