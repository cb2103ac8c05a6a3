#include "pipeline/trace/exact_words.h"

#include "pipeline/base/error.h"
#include "pipeline/base/words.h"

namespace rbvh {
namespace {

template <class Table, class Fits>
std::string names_of(const Table& table, Fits&& fits) {
  std::string names;
  for (const auto& row : table)
    if (fits(row)) names.append(names.empty() ? "" : ", ").append(row.name);
  return names;
}

constexpr auto kAll = [](const auto&) { return true; };

[[noreturn]] void refuse_name(std::string_view name, const std::string& names) {
  throw Error(ErrorKind::kUsage, "", "'" + std::string(name) + "' is none of " + names);
}

}  // namespace

ExactBuilder parse_exact_builder(std::string_view name) {
  if (const auto found = find_exact_builder(name)) return found->builder;
  refuse_name(name, exact_builder_names());
}

ExactTraversal parse_exact_traversal(std::string_view name) {
  if (const auto found = find_exact_traversal(name)) return found->traversal;
  refuse_name(name, names_of(kExactTraversals, kAll));
}

std::vector<ExactTraversal> parse_two_traversals(std::string_view text) {
  std::vector<ExactTraversal> traversals;
  for (const std::string& name : parse_list(text)) traversals.push_back(parse_exact_traversal(name));
  if (traversals.size() != 2)
    throw Error(ErrorKind::kUsage, "",
                "'" + std::string(text) + "' is not two tracers, such as wide16,bvh-stack");
  return traversals;
}

std::string exact_builder_names() { return names_of(kExactBuilders, kAll); }

std::string exact_builder_names(ExactTraversal traversal) {
  return names_of(kExactBuilders,
                  [&](const ExactBuilderInfo& builder) { return builder.tree == info(traversal).tree; });
}

ExactConfig exact_config(std::optional<ExactTraversal> traversal, std::optional<ExactBuilder> builder) {
  ExactConfig config;
  config.traversal = traversal.value_or(kExactTraversals[0].traversal);
  config.builder = builder.value_or(default_builder(config.traversal));
  if (info(config.builder).tree != info(config.traversal).tree)
    throw Error(ErrorKind::kUsage, "",
                std::string("builder ") + info(config.builder).name + " does not fit tracer " +
                    info(config.traversal).name + "; there are " + exact_builder_names(config.traversal));
  return config;
}

}  // namespace rbvh
