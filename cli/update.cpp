// rbvh update: a pair changed in a part of it.
#include "rbvh/update.h"

#include "cli/asset_options.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "io/report_json.h"
#include "io/report_text.h"
#include "pipeline/device/open_meanwhile.h"
#include "pipeline/rbvh/update_words.h"

namespace rbvh {
namespace {

struct UpdateOptions {
  std::string file, add, with;
  std::optional<PairPart> remove, replace;
};

void run_update(Context& context, const UpdateOptions& options) {
  const int wanted = options.remove.has_value() + options.replace.has_value() + !options.add.empty();
  if (wanted != 1 || options.replace.has_value() == options.with.empty())
    throw Error(ErrorKind::kUsage, "", "one change: --remove PART, --add SCAN or --replace PART --with SCAN");
  const std::string added = options.with + options.add;
  const std::string output = change_output(context, options.file, {added});
  std::future<Device> opening = open_meanwhile(context.device);
  Asset pair = load(context, options.file);
  const Scan scan = added.empty() ? Scan() : load_scan(added, context.memory, context.progress.callback());
  time_phase(context, "load");
  const PairPart part = options.replace ? *options.replace : options.remove.value_or(PairPart{});
  const Device device = opening.get();
  report_device(context, device);
  const PairChange change{part.box, part.object, added.empty() ? nullptr : &scan,
                          options.replace.has_value()};
  const UpdateReport done = update_pair(device, pair, change, context.progress.callback());
  time_phase(context, "update");
  context.report.update(update_json(done));
  for (const std::string& line : update_lines(done)) note(context, "rbvh update: " + line);
  write_pair(context, output, *pair.rbvh(), counted(done.levels.size(), "level"));
}

}  // namespace

void add_update(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"update", "Change a part of a pair: what lies in a box, or an object",
                 "rbvh update site.rbvh --replace 10,20,0,15,25,9 --with rescan.ply -o new.rbvh"},
                kWithOutput | kWithDevice | kWithReport, run_update);
  add_change_output(*stage);
  stage->add_option("FILE", options->file, "an .rbvh pair")->required();
  add_parsed(*stage, "--remove", options->remove, parse_pair_part, "PART",
             "what goes: x,y,z,x,y,z (what lies in the box with these corners), or object:N");
  add_parsed(*stage, "--replace", options->replace, parse_pair_part, "PART",
             "what --with takes the place of");
  stage->add_option("--with", options->with, "the scan that does; in a box, its part there")
      ->type_name("SCAN");
  stage->add_option("--add", options->add, "a scan that comes, as objects of its own")->type_name("SCAN");
}

}  // namespace rbvh
