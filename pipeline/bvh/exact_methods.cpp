#include "pipeline/bvh/exact_methods.h"

#include <algorithm>
#include <iterator>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

template <class Table, class Fits>
auto find(const Table& table, Fits&& fits) -> std::optional<std::decay_t<decltype(table[0])>> {
  const auto at = std::find_if(std::begin(table), std::end(table), fits);
  if (at == std::end(table)) return {};
  return *at;
}

template <class Table, class Fits>
const auto& get(const Table& table, Fits&& fits) {
  const auto at = std::find_if(std::begin(table), std::end(table), fits);
  RBVH_CHECK(at != std::end(table));
  return *at;
}

}  // namespace

std::optional<ExactBuilderInfo> find_exact_builder(std::string_view name) {
  return find(kExactBuilders, [&](const ExactBuilderInfo& b) { return b.name == name; });
}

std::optional<ExactTraversalInfo> find_exact_traversal(std::string_view name) {
  return find(kExactTraversals, [&](const ExactTraversalInfo& t) { return t.name == name; });
}

const ExactTraversalInfo& info(ExactTraversal traversal) {
  return get(kExactTraversals, [&](const ExactTraversalInfo& t) { return t.traversal == traversal; });
}

const ExactBuilderInfo& info(ExactBuilder builder) {
  return get(kExactBuilders, [&](const ExactBuilderInfo& b) { return b.builder == builder; });
}

ExactBuilder default_builder(ExactTraversal traversal) {
  return get(kExactBuilders, [&](const ExactBuilderInfo& b) { return b.tree == info(traversal).tree; })
      .builder;
}

}  // namespace rbvh
