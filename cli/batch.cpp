// rbvh batch: a chain of stages over many scans.
#include <filesystem>

#include "batch/batch_table.h"
#include "batch/run_batch.h"
#include "cli/common.h"
#include "cli/exit_code.h"
#include "cli/remedies.h"
#include "cli/stages.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

struct BatchOptions {
  std::vector<std::string> inputs;
  std::string chain;
  int jobs = 0;
  Shard shard;
};

Chain chain_of(const BatchOptions& options) {
  Chain chain = options.chain.empty() ? default_chain() : read_chain(options.chain);
  chain.inputs.insert(chain.inputs.end(), options.inputs.begin(), options.inputs.end());
  if (chain.inputs.empty())
    throw Error(ErrorKind::kUsage, "", "which scans? Name files, folders or a --chain with inputs");
  return chain;
}

void run_stage(Context& context, const BatchOptions& options) {
  const Chain chain = chain_of(options);
  check_paths_differ(context, {options.chain}, {});
  const std::string output = fs::weakly_canonical(fs::absolute(context.output)).string();
  const FoundScans found = find_scans(chain.inputs, output);
  if (found.scans.empty())
    throw Error(ErrorKind::kInput, chain.inputs[0], "no scan is there, by the files' names");
  check_outputs_differ(chain, found.scans, output);
  std::error_code code;
  fs::create_directory(output, code);
  if (!fs::is_directory(output))
    throw Error(ErrorKind::kFailure, context.output, "is no folder, and none can be made there");
  const std::vector<BatchScan> scans = shard(found.scans, options.shard);
  if (found.others > 0)
    note(context, "rbvh batch: " + counted(found.others, "file") + " left out: no scans by their names");
  BatchConfig config{.output = output,
                     .force = context.force,
                     .jobs = options.jobs > 0 ? options.jobs : thread_count(),
                     .threads = thread_count(),
                     .memory = memory_limit(context.memory),
                     .device = context.device};
  const auto results = run_batch(chain, scans, config, [&](const ScanResult& result, std::size_t done) {
    context.progress.update("batch", static_cast<double>(done) / static_cast<double>(scans.size()));
    if (result.state == ScanResult::State::kFailed)
      print_error(context, error_line(*result.error));
    else
      detail(context, "rbvh batch: " + result.scan.name +
                          (result.state == ScanResult::State::kDone ? " done" : " up to date"));
  });
  context.progress.finish();
  const nlohmann::ordered_json table = batch_json(results);
  write_tables(output, options.shard, table);
  context.report.update(table);
  const auto& counts = table["counts"];
  note(context, "rbvh batch: " + counted(scans.size(), "scan") + ": " + counts["done"].dump() + " done, " +
                    counts["up_to_date"].dump() + " up to date, " + counts["failed"].dump() + " failed");
  if (counts["failed"] > 0)
    throw BatchFailure(counts["failed"].dump() + " of " + counted(scans.size(), "scan") +
                       " failed, as said above");
}

}  // namespace

void add_batch(CLI::App& app, Context& context) {
  const auto [stage, options] =
      add_stage(app, context,
                {"batch", "Run a chain of stages over many scans; what is up to date is left alone",
                 "rbvh batch scans/ -o out"},
                kWithOutput | kWithDevice | kWithReport, run_stage);
  stage->add_option("IN", options->inputs, "scans, folders of scans, patterns");
  add_parsed(*stage, "--chain", options->chain, parse_path, "FILE.json",
             "the steps, and scans (default: ingest, build, render)");
  add_parsed(*stage, "--jobs", options->jobs, parse_positive, "N",
             "scans at once (default: one a thread); they share --threads and --memory");
  add_parsed(*stage, "--shard", options->shard, parse_shard, "I/N", "only part I of N, for schedulers");
}

}  // namespace rbvh
