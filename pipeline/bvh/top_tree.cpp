#include "pipeline/bvh/top_tree.h"

#include <algorithm>
#include <numeric>

namespace rbvh {
namespace {

/// Below this depth the larger half decides: what is left is split at the median.
constexpr int kSahDepth = 40;

struct SweepSplit {
  int axis = 0;
  std::size_t left = 0;  ///< boxes on the left
};

SweepSplit best_split(const std::vector<Bounds3f>& boxes, std::vector<std::uint32_t>& items,
                      std::vector<float>& costs) {
  const std::size_t n = items.size();
  SweepSplit best{0, n / 2};
  float best_cost = std::numeric_limits<float>::max();
  for (int axis = 0; axis < 3; ++axis) {
    std::sort(items.begin(), items.end(), [&](std::uint32_t a, std::uint32_t b) {
      const float ca = boxes[a].lo[axis] + boxes[a].hi[axis], cb = boxes[b].lo[axis] + boxes[b].hi[axis];
      return ca != cb ? ca < cb : a < b;
    });
    Bounds3f sweep;
    for (std::size_t i = n - 1; i > 0; --i) {
      sweep.add(boxes[items[i]]);
      costs[i] = sweep.surface_area() * static_cast<float>(n - i);
    }
    sweep = {};
    for (std::size_t i = 1; i < n; ++i) {
      sweep.add(boxes[items[i - 1]]);
      const float cost = sweep.surface_area() * static_cast<float>(i) + costs[i];
      if (cost < best_cost) {
        best_cost = cost;
        best = {axis, i};
      }
    }
  }
  return best;
}

}  // namespace

TopTree build_top_tree(const std::vector<Bounds3f>& boxes) {
  struct Job {
    std::vector<std::uint32_t> items;
    std::uint32_t node;
    int depth;
  };
  TopTree tree;
  if (boxes.empty()) return tree;
  tree.nodes.emplace_back();
  std::vector<float> costs(boxes.size());
  std::vector<std::uint32_t> all(boxes.size());
  std::iota(all.begin(), all.end(), 0u);
  std::vector<Job> jobs;
  jobs.push_back({std::move(all), 0, 0});
  while (!jobs.empty()) {
    Job job = std::move(jobs.back());
    jobs.pop_back();
    Bounds3f b;
    for (const std::uint32_t i : job.items) b.add(boxes[i]);
    RbvhNode& node = tree.nodes[job.node];
    std::copy_n(&b.lo.x, 3, node.lo);
    std::copy_n(&b.hi.x, 3, node.hi);
    if (job.items.size() == 1) {
      node.first = static_cast<std::uint32_t>(tree.order.size());
      node.count = 1;
      tree.order.push_back(job.items[0]);
      continue;
    }
    SweepSplit split = best_split(boxes, job.items, costs);
    if (job.depth >= kSahDepth) split.left = job.items.size() / 2;
    std::sort(job.items.begin(), job.items.end(), [&](std::uint32_t a, std::uint32_t c) {
      const float ca = boxes[a].lo[split.axis] + boxes[a].hi[split.axis],
                  cc = boxes[c].lo[split.axis] + boxes[c].hi[split.axis];
      return ca != cc ? ca < cc : a < c;
    });
    const auto middle = job.items.begin() + static_cast<std::ptrdiff_t>(split.left);
    const auto left = static_cast<std::uint32_t>(tree.nodes.size());
    node.first = left;
    node.count = 0;
    tree.nodes.resize(tree.nodes.size() + 2);
    // The left child is taken next, so leaves are numbered from left to right.
    jobs.push_back({{middle, job.items.end()}, left + 1, job.depth + 1});
    jobs.push_back({{job.items.begin(), middle}, left, job.depth + 1});
  }
  return tree;
}

}  // namespace rbvh
