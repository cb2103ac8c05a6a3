#include "pipeline/bvh/wide_nodes.h"

#include <algorithm>
#include <bit>
#include <limits>

namespace rbvh {
namespace {

float surface(const RbvhNode& n) {
  const float x = n.hi[0] - n.lo[0], y = n.hi[1] - n.lo[1], z = n.hi[2] - n.lo[2];
  return x * y + y * z + z * x;
}

}  // namespace

WideNodes flatten_wide(const std::vector<RbvhNode>& nodes, std::size_t width) {
  struct Job {
    std::uint32_t binary, wide, waiting;
  };
  WideNodes out;
  const std::size_t words = 7 * width;
  std::uint32_t count = 1;
  std::vector<Job> jobs = {{0, 0, 0}};
  std::vector<std::uint32_t> children;
  while (!jobs.empty()) {
    const Job job = jobs.back();
    jobs.pop_back();
    children.assign(1, job.binary);
    while (children.size() < width) {
      std::size_t widest = children.size();
      for (std::size_t k = 0; k < children.size(); ++k)
        if (nodes[children[k]].count == 0 &&
            (widest == children.size() || surface(nodes[children[k]]) > surface(nodes[children[widest]])))
          widest = k;
      if (widest == children.size()) break;
      const std::uint32_t first = nodes[children[widest]].first;
      children[widest] = first;
      children.push_back(first + 1);
    }
    out.words.resize(std::max(out.words.size(), words * (static_cast<std::size_t>(job.wide) + 1)));
    const std::uint32_t waiting = job.waiting + static_cast<std::uint32_t>(children.size()) - 1;
    out.stack_needed = std::max(out.stack_needed, waiting + 1);
    for (std::size_t k = 0; k < width; ++k) {
      std::uint32_t* slot = out.words.data() + words * job.wide + k;
      if (k >= children.size()) {
        for (std::size_t i = 0; i < 6; ++i) slot[i * width] = std::bit_cast<std::uint32_t>(1e38f);
        slot[6 * width] = static_cast<std::uint32_t>(std::numeric_limits<std::int32_t>::min());
        continue;
      }
      const RbvhNode& child = nodes[children[k]];
      for (std::size_t i = 0; i < 3; ++i) {
        slot[i * width] = std::bit_cast<std::uint32_t>(child.lo[i]);
        slot[(3 + i) * width] = std::bit_cast<std::uint32_t>(child.hi[i]);
      }
      if (child.count == 0) {
        slot[6 * width] = count;
        jobs.push_back({children[k], count++, waiting});
      } else {
        slot[6 * width] = ~child.first;
      }
    }
  }
  return out;
}

}  // namespace rbvh
