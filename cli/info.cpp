// rbvh info: what a pair, a proxy, a scan or a scene holds.

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/stages.h"
#include "io/describe.h"
#include "io/describe_text.h"

namespace rbvh {
namespace {

struct Options {
  std::vector<std::string> files;
  bool as_json = false, with_bytes = false;
};

void run_info(Context& context, const Options& options) {
  for_each_file(context, options.files, [&](const std::string& path) {
    const nlohmann::ordered_json json = describe(path, {.memory = context.memory});
    if (options.with_bytes && json["kind"] != "rbvh")
      throw Error(ErrorKind::kUsage, path, "--bytes is for pairs, and this is none");
    options.as_json ? print_json(json) : print_data(describe_text(json, options.with_bytes));
  });
}

}  // namespace

void add_info(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"info", "Say what a pair, a proxy, a scan or a scene holds", "rbvh info dragon.rbvh --json"},
                0, run_info);
  stage
      ->add_option("FILE", options->files,
                   ".rbvh pairs, proxies, scans (-: standard input) or scenes (.json)")
      ->required();
  stage->add_flag("--bytes", options->with_bytes,
                  "of a pair, also where its bytes are: each level's streams and layers");
  stage->add_flag("--json", options->as_json, "as JSON; of several files, one object after the other");
}

}  // namespace rbvh
