#include "cli/exact_options.h"

#include "cli/common.h"
#include "io/report_text.h"

namespace rbvh {
namespace {

template <class Table>
std::string names_of(const Table& table) {
  std::string names;
  for (const auto& row : table) names += (names.empty() ? "" : ", ") + std::string(row.name);
  return names;
}

ExactBuilder parse_builder(std::string_view name) {
  if (const auto found = find_exact_builder(name)) return found->builder;
  throw Error(ErrorKind::kUsage, "", "'" + std::string(name) + "' is none of " + names_of(kExactBuilders));
}

ExactTraversal parse_tracer_or_list(std::string_view name) {
  if (name == "list") {
    print_data(exact_methods_text());
    throw CLI::Success();  // needs no other word
  }
  return parse_tracer(name);
}

}  // namespace

ExactTraversal parse_tracer(std::string_view name) {
  if (const auto found = find_exact_traversal(name)) return found->traversal;
  throw Error(ErrorKind::kUsage, "",
              "'" + std::string(name) + "' is none of " + names_of(kExactTraversals) + "; see --tracer list");
}

void add_exact_options(CLI::App& stage, ExactOptions& options) {
  add_parsed(
      stage, "--tracer", options.tracer, parse_tracer_or_list, "NAME",
      std::string("how a scan is cast (default: ") + kExactTraversals[0].name + "); list: prints them all")
      ->trigger_on_parse();
  add_parsed(stage, "--builder", options.builder, parse_builder, "NAME",
             "how a scan's hierarchy is built: " + names_of(kExactBuilders) +
                 " (default: the first that fits the tracer)");
}

ExactConfig exact_config(const ExactOptions& options, std::optional<ExactTraversal> tracer) {
  ExactConfig config;
  config.traversal = tracer.value_or(options.tracer.value_or(kExactTraversals[0].traversal));
  config.builder = options.builder.value_or(default_builder(config.traversal));
  if (info(config.builder).tree != info(config.traversal).tree)
    throw Error(ErrorKind::kUsage, "",
                std::string("--builder ") + info(config.builder).name + " does not fit --tracer " +
                    info(config.traversal).name + "; see --tracer list");
  return config;
}

void report_exact(Context& context, const ExactConfig& config) {
  context.report["tracer"] = info(config.traversal).name;
  context.report["builder"] = info(config.builder).name;
}

void check_exact_options(const ExactOptions& options, const ExactConfig& config, const Asset& asset) {
  if (asset.scene()) return;  // whichever of its objects are scans
  if (asset.rbvh()) {
    if (options.tracer || options.builder)
      throw Error(ErrorKind::kUsage, asset.path, "--tracer and --builder are for scans; this is a pair");
  } else if (asset.is_cloud && !info(config.traversal).discs) {
    throw Error(ErrorKind::kUsage, asset.path,
                std::string("--tracer ") + info(config.traversal).name +
                    " casts triangles only, and this is a cloud; take " + kExactTraversals[0].name);
  }
}

}  // namespace rbvh
