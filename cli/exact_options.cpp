#include "cli/exact_options.h"

#include "cli/common.h"
#include "io/report_text.h"

namespace rbvh {
namespace {

ExactTraversal parse_tracer_or_list(std::string_view name) {
  if (name != "list") return parse_exact_traversal(name);
  print_data(exact_methods_text());
  throw CLI::Success();  // needs no other word
}

}  // namespace

void add_exact_options(CLI::App& stage, ExactOptions& options) {
  add_parsed(
      stage, "--tracer", options.tracer, parse_tracer_or_list, "NAME",
      std::string("how a scan is cast (default: ") + kExactTraversals[0].name + "); list: prints them all")
      ->trigger_on_parse();
  add_parsed(stage, "--builder", options.builder, parse_exact_builder, "NAME",
             "how a scan's hierarchy is built: " + exact_builder_names() +
                 " (default: the first that fits the tracer)");
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
