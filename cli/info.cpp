// rbvh info: what a pair, a proxy, a scan or a scene holds.
#include <memory>

#include "cli/common.h"
#include "cli/stages.h"
#include "io/describe.h"
#include "io/describe_text.h"

namespace rbvh {
namespace {

void run_info(Context& context, const std::string& path, bool as_json, bool with_bytes) {
  const nlohmann::ordered_json json = describe(path, {.memory = context.memory});
  if (with_bytes && json["kind"] != "rbvh")
    throw Error(ErrorKind::kUsage, path, "--bytes is for pairs, and this is none");
  as_json ? print_json(json) : print_data(describe_text(json, with_bytes));
}

}  // namespace

void add_info(CLI::App& app, Context& context) {
  struct Options {
    std::string file;
    bool as_json = false, with_bytes = false;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* stage = add_stage(
      app, context,
      {"info", "Say what a pair, a proxy, a scan or a scene holds", "rbvh info dragon.rbvh --json"}, 0,
      [&context, options] { run_info(context, options->file, options->as_json, options->with_bytes); });
  stage->add_option("FILE", options->file, "an .rbvh, a proxy, a scan (-: standard input) or a scene (.json)")
      ->required();
  stage->add_flag("--bytes", options->with_bytes,
                  "of a pair, also where its bytes are: each level's streams and layers");
  stage->add_flag("--json", options->as_json, "as JSON");
}

}  // namespace rbvh
