#include "cli/pair_output.h"

#include <filesystem>

namespace rbvh {

void check_pair_output(const Context& context) {
  const std::filesystem::path path = context.output;
  if (path.has_extension() && path.extension() != ".rbvh")
    throw Error(ErrorKind::kUsage, context.output,
                "a pair is NAME.rbvh and NAME.atlas.tif beside it; name the output " +
                    std::filesystem::path(path).replace_extension(".rbvh").string());
  check_rbvh_output(context.output, context.force);
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
