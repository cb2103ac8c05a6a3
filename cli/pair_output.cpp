#include "cli/pair_output.h"

#include <filesystem>

#include "cli/asset_options.h"

namespace rbvh {

void check_pair_output(const Context& context) {
  const std::filesystem::path path = context.output;
  if (path.has_extension() && path.extension() != ".rbvh")
    throw Error(ErrorKind::kUsage, context.output,
                "a pair is NAME.rbvh and NAME.atlas.tif beside it; name the output " +
                    std::filesystem::path(path).replace_extension(".rbvh").string());
  check_rbvh_output(context.output, context.force);
}

void add_change_output(CLI::App& stage) {
  stage.get_option("--output")
      ->required(false)
      ->description("the pair to write (default: FILE itself, with -f)");
}

std::string change_output(Context& context, const std::string& pair, std::vector<std::string> others) {
  std::string output = context.output.empty() ? pair : context.output;
  if (output != pair) others.insert(others.end(), {pair, atlas_path(pair)});
  check_paths_differ(context, others, {output, atlas_path(output)});
  if (context.output.empty())
    check_rbvh_output(output, context.force);
  else
    check_pair_output(context);
  check_is_pair(pair);
  return output;
}

RbvhBytes write_pair(Context& context, const std::string& output, const Rbvh& rbvh, const std::string& what) {
  RbvhBytes bytes = write_rbvh(output, rbvh, context.force);
  time_phase(context, "write");
  report_pair(context, output, bytes, what);
  return bytes;
}

void report_pair(Context& context, const std::string& output, const RbvhBytes& bytes,
                 const std::string& what) {
  context.report["bytes"] = {{"hierarchy", bytes.hierarchy}, {"atlas", bytes.atlas}};
  note(context, "rbvh " + context.stage + ": wrote " + output + " (" + what + ", " +
                    format_bytes(bytes.hierarchy + bytes.atlas) + " with its atlas)");
}

}  // namespace rbvh
