#include "pipeline/bvh/collapse.h"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

/// The costs of a subtree as a forest of at most 1, 2, .. roots. From `most` roots on, its leaves or the
/// width, no further root makes it cheaper.
struct Forest {
  const float* costs;
  std::uint32_t most;
};

struct Share {
  float cost = std::numeric_limits<float>::infinity();
  std::uint32_t left = 0;
};

/// The cheapest way to share `roots` among two children.
Share best_share(const Forest& left, const Forest& right, std::uint32_t roots) {
  const std::uint32_t first = roots > right.most ? roots - right.most : 1,
                      last = std::min(roots - 1, left.most);
  Share best{std::numeric_limits<float>::infinity(), first};
  for (std::uint32_t k = first; k <= last; ++k) {
    const float cost = left.costs[k - 1] + right.costs[roots - k - 1];
    if (cost < best.cost) best = {cost, k};
  }
  return best;
}

}  // namespace

Collapse collapse(const Bvh& bvh, std::uint32_t width) {
  RBVH_CHECK(width >= 2 && width <= kMaxWidth);
  Collapse result;
  result.width = width;
  const std::size_t count = bvh.nodes.size();
  if (count == 0) return result;
  result.choices.resize(count * width);
  const auto costs = std::make_unique_for_overwrite<float[]>(count * width);
  std::vector<std::uint8_t> most(count, 1);
  const auto forest = [&](std::uint32_t node) {
    return Forest{&costs[std::size_t{node} * width], most[node]};
  };
  for (std::size_t n = count; n-- > 0;) {
    const BvhNode& node = bvh.nodes[n];
    float* cost = &costs[n * width];
    if (node.count > 0) {
      cost[0] = 0;
      continue;
    }
    std::uint8_t* choice = &result.choices[n * width];
    const Forest left = forest(node.first), right = forest(node.first + 1);
    const std::uint32_t roots = std::min(width, left.most + right.most);
    most[n] = static_cast<std::uint8_t>(roots);
    std::array<Share, kMaxWidth> shares;
    for (std::uint32_t i = 2; i <= roots; ++i) shares[i - 1] = best_share(left, right, i);
    choice[0] = static_cast<std::uint8_t>(shares[roots - 1].left);
    cost[0] = node.bounds.surface_area() + shares[roots - 1].cost;
    for (std::uint32_t i = 2; i <= roots; ++i) {
      const bool better = shares[i - 1].cost <= cost[i - 2];  // of equals fewer nodes
      cost[i - 1] = better ? shares[i - 1].cost : cost[i - 2];
      choice[i - 1] = better ? static_cast<std::uint8_t>(shares[i - 1].left) : std::uint8_t{0};
    }
  }
  result.cost = static_cast<double>(costs[0]);
  return result;
}

WideChildren wide_children(const Bvh& bvh, const Collapse& collapse, std::uint32_t node) {
  struct Forest {
    std::uint32_t node, roots;
  };
  const auto leaves_at_most = [&](std::uint32_t n, std::uint32_t roots) {
    return bvh.nodes[n].count > 0 ? 1 : roots;
  };
  WideChildren children;
  std::array<Forest, kMaxWidth + 1> stack;
  std::size_t depth = 0;
  const auto share = [&](std::uint32_t n, std::uint32_t roots, std::uint32_t left) {
    const std::uint32_t first = bvh.nodes[n].first;
    stack[depth++] = {first + 1, leaves_at_most(first + 1, roots - left)};
    stack[depth++] = {first, leaves_at_most(first, left)};
  };
  const std::uint8_t* choices = collapse.choices.data();
  share(node, collapse.width, choices[std::size_t{node} * collapse.width]);
  while (depth > 0) {
    Forest f = stack[--depth];
    while (f.roots > 1 && choices[std::size_t{f.node} * collapse.width + f.roots - 1] == 0) --f.roots;
    if (f.roots == 1)
      children.nodes[children.count++] = f.node;
    else
      share(f.node, f.roots, choices[std::size_t{f.node} * collapse.width + f.roots - 1]);
  }
  return children;
}

}  // namespace rbvh
