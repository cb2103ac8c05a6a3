// rbvh lod: a smaller pair of a pair, by levels, bytes or error.
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>

#include "cli/asset_options.h"
#include "cli/common.h"
#include "cli/pair_output.h"
#include "cli/stages.h"
#include "cli/views_options.h"
#include "io/rbvh_file.h"
#include "pipeline/measure/measure_json.h"
#include "pipeline/rbvh/lod.h"

namespace rbvh {
namespace {

struct LodOptions {
  std::string file, against;
  std::vector<std::string> levels, dropped;
  std::optional<std::uint64_t> most_bytes;
  std::optional<double> most_error;  // percent of the diagonal
  ViewsConfig views;
};

double parse_percent(std::string_view text) {
  const double value = parse_number(text);
  if (!(value > 0)) throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not above 0");
  return value;
}

std::string names_of(const std::vector<Level>& levels) {
  std::string names;
  for (const Level& level : levels) names += (names.empty() ? "" : ", ") + level.name;
  return names;
}

[[noreturn]] void refuse_level(const Asset& pair, const std::string& name) {
  throw Error(ErrorKind::kUsage, pair.path,
              "there is no level '" + name + "'; there are " + names_of(pair.rbvh()->levels) +
                  ", and standard levels coarser than the finest of them can be derived");
}

/// Standard levels that are not in the pair and are coarser than `than`.
std::vector<LevelConfig> derivable(const Rbvh& rbvh, const Level& than) {
  std::vector<LevelConfig> configs;
  for (const LevelConfig& config : standard_levels())
    if (rbvh.find_level(config.name) == nullptr && config.rho < than.rho) configs.push_back(config);
  return configs;
}

class Lod {
 public:
  Lod(Context& context, const LodOptions& options) : context_(context), options_(options) {}

  void run() {
    check_paths_differ(context_, {options_.file, atlas_path(options_.file), options_.against},
                       {context_.output, atlas_path(context_.output)});
    check_pair_output(context_);
    Stopwatch watch;
    if (!is_rbvh(options_.file)) throw Error(ErrorKind::kInput, options_.file, "is no .rbvh pair");
    pair_ = load(context_, options_.file);
    Rbvh& rbvh = std::get<Rbvh>(pair_.content);
    const double load_seconds = watch.lap();
    finest_ = rbvh.levels.front();
    choose_by_name(rbvh);
    measure(rbvh);
    if (options_.most_error) choose_by_error(rbvh);
    const double work_seconds = watch.lap();
    const RbvhBytes bytes =
        options_.most_bytes ? write_within(rbvh) : write_rbvh(context_.output, rbvh, context_.force);
    auto& report = context_.report;
    report["timings"] = {{"load", load_seconds}, {"levels", work_seconds}, {"write", watch.lap()}};
    for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
      const Level& level = rbvh.levels[i];
      report["levels"].push_back({{"name", level.name},
                                  {"derived_from", level.derived_from},
                                  {"bytes", bytes.levels[i]},
                                  {"fidelity", fidelity_json(level.fidelity)}});
    }
    report_pair(context_, context_.output, bytes, names_of(rbvh.levels));
  }

 private:
  const Device& device() {
    if (!device_) {
      device_ = Device::open(context_.device);
      context_.report["device"] = device_json(device_->info());
    }
    return *device_;
  }

  void derive(Rbvh& rbvh, const std::vector<LevelConfig>& configs) {
    if (configs.empty()) return;
    std::vector<Level> derived =
        derive_levels(device(), rbvh, finest_, configs, context_.progress.callback());
    std::move(derived.begin(), derived.end(), std::back_inserter(rbvh.levels));
    std::stable_sort(rbvh.levels.begin(), rbvh.levels.end(),
                     [](const Level& a, const Level& b) { return a.rho > b.rho; });
  }

  void choose_by_name(Rbvh& rbvh) {
    const auto is_in = [](const std::vector<std::string>& names, const std::string& name) {
      return std::find(names.begin(), names.end(), name) != names.end();
    };
    for (const std::string& name : options_.dropped)
      if (rbvh.find_level(name) == nullptr) refuse_level(pair_, name);
    if (!options_.levels.empty()) {
      const std::vector<LevelConfig> possible = derivable(rbvh, finest_);
      std::vector<LevelConfig> wanted;
      for (const LevelConfig& config : possible)
        if (is_in(options_.levels, config.name)) wanted.push_back(config);
      for (const std::string& name : options_.levels)
        if (rbvh.find_level(name) == nullptr &&
            std::none_of(wanted.begin(), wanted.end(), [&](const LevelConfig& c) { return c.name == name; }))
          refuse_level(pair_, name);
      derive(rbvh, wanted);
      std::erase_if(rbvh.levels, [&](const Level& level) { return !is_in(options_.levels, level.name); });
    }
    std::erase_if(rbvh.levels, [&](const Level& level) { return is_in(options_.dropped, level.name); });
    if (rbvh.levels.empty()) throw Error(ErrorKind::kUsage, options_.file, "--drop: no level would be left");
  }

  // With the scan at hand, what has not been measured is.
  void measure(Rbvh& rbvh) {
    std::vector<std::string> levels;
    for (const Level& level : rbvh.levels)
      if (std::isnan(error_percent(level.fidelity))) levels.push_back(level.name);
    if (options_.against.empty() || levels.empty()) return;
    const Asset exact = load_reference(options_.against, rbvh, context_.memory, context_.progress.callback());
    // Here it is not only said: the pair would keep the figures for good.
    if (const auto other = find_other_scan(pair_, exact))
      throw Error(ErrorKind::kInput, options_.against, *other);
    MeasureConfig config;
    config.views = options_.views;
    config.images = config.distances = true;
    config.memory = context_.memory;
    for (const LevelMeasure& m :
         measure_levels(device(), pair_, exact, levels, config, context_.progress.callback()))
      for (Level& level : rbvh.levels)
        if (level.name == m.level) level.fidelity = stored_fidelity(m, config.views);
  }

  void choose_by_error(Rbvh& rbvh) {
    const double most = *options_.most_error;
    std::size_t chosen = rbvh.levels.size();
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < rbvh.levels.size(); ++i) {
      const double error = error_percent(rbvh.levels[i].fidelity);
      if (std::isnan(error))
        throw Error(ErrorKind::kInput, options_.file,
                    "level " + rbvh.levels[i].name +
                        (options_.against.empty()
                             ? " was not measured; build with --measure, or name the scan with --against"
                             : " and " + options_.against + " are hit by no ray both; is it another scan?"));
      least = std::min(least, error);
      if (error <= most) chosen = i;  // finest first: the last one is the smallest
    }
    if (chosen == rbvh.levels.size())
      throw Error(ErrorKind::kBudget, options_.file,
                  "no level is within an error of " + number(most) + "% of the diagonal; the best has " +
                      number(least) + "%");
    rbvh.levels = {std::move(rbvh.levels[chosen])};
  }

  RbvhBytes write_within(Rbvh& rbvh) {
    const std::uint64_t most = *options_.most_bytes;
    RbvhBytes all = write_rbvh(context_.output, rbvh, context_.force, 0);  // measures, writes nothing
    const auto smallest = [&] {
      // With what a pair has beside its levels.
      const std::uint64_t own = std::accumulate(all.levels.begin(), all.levels.end(), std::uint64_t{0});
      return *std::min_element(all.levels.begin(), all.levels.end()) + all.hierarchy + all.atlas - own;
    };
    if (options_.levels.empty() && !options_.most_error && smallest() > most) {
      derive(rbvh, derivable(rbvh, rbvh.levels.back()));
      all = write_rbvh(context_.output, rbvh, context_.force, 0);
    }
    // What is not any level's own (names, headers) is known only of a whole pair: where it does not fit, the
    // next set that takes less is tried.
    const std::vector<Level> levels = std::move(rbvh.levels);
    for (std::uint64_t room = most;;) {
      std::uint64_t taken = 0;
      rbvh.levels.clear();
      for (const std::size_t i : choose_levels_by_bytes(all.levels, room)) {
        rbvh.levels.push_back(levels[i]);
        taken += all.levels[i];
      }
      if (rbvh.levels.empty())
        throw Error(
            ErrorKind::kBudget, options_.file,
            "no level fits into " + format_bytes(most) + "; the smallest takes " + format_bytes(smallest()));
      RbvhBytes bytes = write_rbvh(context_.output, rbvh, context_.force, most);
      if (bytes.hierarchy + bytes.atlas <= most) return bytes;
      room = taken - 1;
    }
  }

  static std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return text;
  }

  Context& context_;
  const LodOptions& options_;
  Asset pair_;
  Level finest_;  // that came in: what others are derived from
  std::optional<Device> device_;
};

}  // namespace

void add_lod(CLI::App& app, Context& context) {
  const auto options = std::make_shared<LodOptions>();
  CLI::App* stage =
      add_stage(app, context,
                {"lod", "Make a smaller pair: fewer or coarser levels",
                 "rbvh lod dragon.rbvh --max-bytes 2MB -o small.rbvh"},
                kWithOutput | kWithDevice | kWithReport, [&context, options] {
                  if (options->levels.empty() && options->dropped.empty() && !options->most_bytes &&
                      !options->most_error)
                    throw Error(ErrorKind::kUsage, "",
                                "say which levels: --levels, --drop, --max-bytes or --max-error");
                  Lod(context, *options).run();
                });
  stage->add_option("FILE", options->file, "an .rbvh pair")->required();
  add_parsed(*stage, "--levels", options->levels, parse_list, "Q1,Q3",
             "keep these; one that is not there is derived from the finest");
  add_parsed(*stage, "--drop", options->dropped, parse_list, "Q0", "keep all but these");
  add_parsed(
      *stage, "--max-bytes", options->most_bytes, parse_file_size, "SIZE",
      "the finest levels that fit into both files together, such as 2MB (exit 5: none); where even the "
      "coarsest is too large, coarser ones are derived");
  add_parsed(*stage, "--max-error", options->most_error, parse_percent, "PERCENT",
             "the smallest level whose surface distance (rms, the larger of both ways, % of the diagonal) is "
             "within; as build --measure stored it, or see --against");
  stage->add_option("--against", options->against, "the scan: measures the levels that were not measured yet")
      ->type_name("SCAN");
  add_views_options(*stage, options->views, "--against");
}

}  // namespace rbvh
