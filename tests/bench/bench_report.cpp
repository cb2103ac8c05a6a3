#include "tests/bench/bench_report.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "io/output_file.h"
#include "tests/bench/paper_tables.h"

namespace rbvh::bench {
namespace {

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

const RaysResult* find_rays(const Report& report, const std::string& rays, const std::string& engine,
                            const std::string& name) {
  for (const RaysResult& r : report.rays) {
    if (r.rays == rays && r.engine == engine && (name.empty() || r.name == name)) return &r;
  }
  return nullptr;
}

/// Embree's fastest for those rays.
const RaysResult* best_embree(const Report& report, const std::string& rays) {
  const RaysResult* best = nullptr;
  for (const RaysResult& r : report.rays) {
    if (r.rays == rays && r.engine == "embree" && (best == nullptr || r.mrays() > best->mrays())) best = &r;
  }
  return best;
}

std::string primitives(const Report& r) {
  const bool cloud = r.triangles == 0;
  const auto count = static_cast<double>(cloud ? r.points : r.triangles);
  return (count >= 1e6 ? format("%.2f M", count * 1e-6) : format("%.0f k", count * 1e-3)) +
         (cloud ? " discs" : " tris");
}

std::string megabytes(std::size_t bytes) { return format("%.2f", static_cast<double>(bytes) * 1e-6); }

std::size_t primitive_count(const Report& r) { return r.triangles > 0 ? r.triangles : r.points; }

void table_1(const std::vector<Report>& reports, std::string& out) {
  out +=
      "\nTable 1: where nodes are split, Q0 (rates in million rays per second, and of the surface area "
      "heuristic's; the paper's seconds are one core's)\n\n"
      "| Scene | Split | by | Nodes | Partition [s] | Build [s] | Primary | of SAH | Diffuse | of SAH | "
      "Paper: "
      "nodes | build [s] | rate | of SAH |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Report& r : reports) {
    const PaperSplits& paper = nearest_scene(kPaperTable1, primitive_count(r));
    for (const SplitResult& split : r.splits) {
      const SplitResult* sah = nullptr;
      for (const SplitResult& other : r.splits)
        if (other.is_sah && other.on_host == split.on_host) sah = &other;
      const auto of_sah = [&](const RaysResult SplitResult::*rays) {
        return sah == nullptr ? 0 : median_ratio((sah->*rays).timing, (split.*rays).timing);
      };
      double partition = 0;
      for (const BuildResult::Phase& phase : split.build.phases)
        if (phase.name == "partition") partition = phase.timing.median();
      out += format("| %s (%s) | %s | %s | %zu | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f |", r.scan.c_str(),
                    primitives(r).c_str(), split.is_sah ? "SAH" : "median", split.on_host ? "host" : "device",
                    split.nodes, partition, split.build.total.median(), split.primary.mrays(),
                    of_sah(&SplitResult::primary), split.diffuse.count > 0 ? split.diffuse.mrays() : 0.0,
                    split.diffuse.count > 0 ? of_sah(&SplitResult::diffuse) : 0.0);
      const PaperSplits::Row& row = split.is_sah ? paper.sah : paper.median;
      out += format(" %.0f (%s) | %.1f | %.1f | %.2f |\n", row.nodes, paper.scene, row.seconds, row.mrays,
                    row.mrays / paper.sah.mrays);
    }
  }
}

void table_2(const std::vector<Report>& reports, std::string& out) {
  for (const std::string rays : {"primary", "diffuse"}) {
    out += "\nTable 2: " + rays +
           " rays, million per second; of the triangle BVH's (ours: Embree's best, medians of ratios)\n\n"
           "| Scene | Structure | Rate | of the BVH | Paper: scene | rate | of the BVH |\n"
           "| --- | --- | --- | --- | --- | --- | --- |\n";
    for (const Report& r : reports) {
      const PaperRates& paper = nearest_scene(kPaperTable2, primitive_count(r));
      const double paper_bvh = rays == "primary" ? paper.primary_bvh : paper.diffuse_bvh;
      const std::string scene = r.scan + " (" + primitives(r) + ")";
      if (const RaysResult* embree = best_embree(r, rays))
        out += format("| %s | BVH: Embree, %s | %.2f | 1 | %s | %.1f | 1 |\n", scene.c_str(),
                      embree->name.c_str(), embree->mrays(), paper.scene, paper_bvh);
      if (const RaysResult* exact = find_rays(r, rays, "exact", {}))
        out += format("| %s | BVH: ours, exact | %.2f | %.2f | | | |\n", scene.c_str(), exact->mrays(),
                      exact->speedup);
      for (std::size_t i = 0; i < r.levels.size(); ++i) {
        const RaysResult* traced = find_rays(r, rays, "rbvh", r.levels[i].name);
        if (traced == nullptr || i >= paper.primary.size()) continue;
        const double paper_rate = (rays == "primary" ? paper.primary : paper.diffuse)[i];
        out +=
            format("| %s | %s | %.2f | %.2f | %s | %.1f | %.2f |\n", scene.c_str(), r.levels[i].name.c_str(),
                   traced->mrays(), traced->speedup, paper.scene, paper_rate, paper_rate / paper_bvh);
      }
    }
  }
}

void table_3(const std::vector<Report>& reports, std::string& out) {
  out +=
      "\nTable 3: memory in megabytes: tree + geometry (triangles or atlas) = total, and of the BVH's (ours: "
      "Embree MEDIUM)\n\n"
      "| Scene | Structure | Tree | Geometry | Total | bytes a primitive | of the BVH | Paper: scene | total "
      "| bytes a "
      "triangle | of the BVH |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Report& r : reports) {
    double whole = 0;
    for (const MemoryResult& m : r.memory) {
      if (m.engine == "embree" && whole == 0) whole = static_cast<double>(m.total());
    }
    const PaperMemory& paper = nearest_scene(kPaperTable3, primitive_count(r));
    const double paper_whole = paper.bvh_tree + paper.bvh_triangles;
    for (const MemoryResult& m : r.memory) {
      const double theirs = m.engine == "embree" ? paper_whole
                            : m.name == "Q0"     ? paper.q0_tree + paper.q0_atlas
                            : m.name == "Q2"     ? paper.q2
                            : m.name == "Q4"     ? paper.q4
                                                 : 0;
      out +=
          format("| %s (%s) | %s %s | %s | %s | %s | %.2f | %s |", r.scan.c_str(), primitives(r).c_str(),
                 m.engine.c_str(), m.name.c_str(), megabytes(m.tree).c_str(), megabytes(m.geometry).c_str(),
                 megabytes(m.total()).c_str(),
                 static_cast<double>(m.total()) / static_cast<double>(primitive_count(r)),
                 whole > 0 ? format("%.1f%%", 100.0 * static_cast<double>(m.total()) / whole).c_str() : "-");
      out += theirs > 0 ? format(" %s | %.2f | %.2f | %.1f%% |\n", paper.scene, theirs,
                                 theirs * 1e6 / paper.triangles, 100 * theirs / paper_whole)
                        : std::string(" | | | |\n");
    }
  }
}

void table_4(const std::vector<Report>& reports, std::string& out) {
  out +=
      "\nTable 4: build times in milliseconds (medians); \"host\": one core of the host partitions, the "
      "device "
      "rasterises\n\n| Scene | Structure | Total | Phases | Paper: scene | total |\n| --- | --- | --- | --- "
      "| --- | "
      "--- |\n";
  constexpr const char* kRows[] = {"Q0", "Q2", "Q4"};
  for (const Report& r : reports) {
    const PaperBuilds& paper = nearest_scene(kPaperTable4, primitive_count(r));
    for (const BuildResult& b : r.builds) {
      std::string phases;
      for (const BuildResult::Phase& phase : b.phases) {
        phases +=
            (phases.empty() ? "" : ", ") + format("%s %.0f", phase.name.c_str(), phase.timing.median() * 1e3);
      }
      std::string theirs = " | |";
      for (std::size_t i = 0; i < std::size(kRows) && b.engine == "rbvh"; ++i) {
        if (b.name == kRows[i]) theirs = format(" %s, GPU | %.0f |", paper.scene, paper.gpu[i]);
        if (b.name == std::string(kRows[i]) + " host")
          theirs = format(" %s, CPU | %.0f |", paper.scene, paper.cpu[i]);
      }
      out += format("| %s (%s) | %s %s | %.0f | %s |%s\n", r.scan.c_str(), primitives(r).c_str(),
                    b.engine.c_str(), b.name.c_str(), b.total.median() * 1e3, phases.c_str(), theirs.c_str());
    }
  }
}

void levels_table(const std::vector<Report>& reports, std::string& out) {
  out +=
      "\nLevels\n\n| Scene | Level | Nodes | Leaves | Texels | Used |\n| --- | --- | --- | --- | --- | --- "
      "|\n";
  for (const Report& r : reports)
    for (const LevelResult& level : r.levels)
      out += format("| %s (%s) | %s | %zu | %zu | %zu | %.0f%% |\n", r.scan.c_str(), primitives(r).c_str(),
                    level.name.c_str(), level.nodes, level.leaves, level.texels,
                    100.0 * static_cast<double>(level.texels_used) /
                        static_cast<double>(std::max<std::size_t>(1, level.texels)));
}

/// A CSV field: quoted where it must be.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

nlohmann::ordered_json timing_json(const Timing& timing) {
  return {{"median", timing.median()},
          {"least", timing.least()},
          {"most", timing.most()},
          {"all", timing.seconds}};
}

}  // namespace

double Timing::median() const { return median_of(seconds); }
double Timing::least() const {
  return seconds.empty() ? 0 : *std::min_element(seconds.begin(), seconds.end());
}
double Timing::most() const {
  return seconds.empty() ? 0 : *std::max_element(seconds.begin(), seconds.end());
}

double median_ratio(const Timing& a, const Timing& b) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(a.seconds.size(), b.seconds.size()); ++i) {
    ratios.push_back(a.seconds[i] / b.seconds[i]);
  }
  return median_of(ratios);
}

int compare_with_best(Report& report, const std::string& rays) {
  const RaysResult* best = best_embree(report, rays);
  if (best == nullptr) return -1;
  for (RaysResult& r : report.rays) {
    if (r.rays == rays) r.speedup = median_ratio(best->timing, r.timing);
  }
  return static_cast<int>(best - report.rays.data());
}

std::string markdown(const std::vector<Report>& reports, const std::vector<int>& tables) {
  std::string out;
  if (reports.empty()) return out;
  const Report& r = reports.front();
  out += format("rbvh %s on %s; %s; %d threads; %u x %u primary rays; %d interleaved repetitions, medians\n",
                r.version.c_str(), r.device.c_str(),
                r.embree.empty() ? "without Embree" : ("Embree " + r.embree).c_str(), r.threads, r.resolution,
                r.resolution, r.repetitions);
  const auto wants = [&](int table) {
    return std::find(tables.begin(), tables.end(), table) != tables.end();
  };
  if (wants(1)) table_1(reports, out);
  if (wants(2)) table_2(reports, out);
  if (wants(3)) table_3(reports, out);
  if (wants(4)) table_4(reports, out);
  levels_table(reports, out);
  return out;
}

std::string csv(const std::vector<Report>& reports) {
  std::string out = "scan,primitives,section,engine,name,figure,unit,median,least,most,repetitions\n";
  for (const Report& r : reports) {
    const std::size_t count = r.triangles > 0 ? r.triangles : r.points;
    const auto row = [&](const char* section, const std::string& engine, const std::string& name,
                         const std::string& figure, const char* unit, double median, double least,
                         double most, std::size_t repetitions) {
      out += field(r.scan) + format(",%zu,%s,", count, section) + field(engine) + "," + field(name) + "," +
             field(figure) + format(",%s,%.9g,%.9g,%.9g,%zu\n", unit, median, least, most, repetitions);
    };
    const auto figure = [&](const char* section, const std::string& engine, const std::string& name,
                            const char* what, const char* unit,
                            double value) { row(section, engine, name, what, unit, value, value, value, 1); };
    for (const LevelResult& level : r.levels) {
      figure("level", "rbvh", level.name, "nodes", "1", static_cast<double>(level.nodes));
      figure("level", "rbvh", level.name, "leaves", "1", static_cast<double>(level.leaves));
      figure("level", "rbvh", level.name, "texels", "1", static_cast<double>(level.texels));
      figure("level", "rbvh", level.name, "texels used", "1", static_cast<double>(level.texels_used));
    }
    for (const RaysResult& x : r.rays) {
      const auto rate = [&](double seconds) { return static_cast<double>(x.count) / seconds * 1e-6; };
      row(x.rays.c_str(), x.engine, x.name, "speed", "Mrays/s", rate(x.timing.median()),
          rate(x.timing.most()), rate(x.timing.least()), x.timing.seconds.size());
      figure(x.rays.c_str(), x.engine, x.name, "rays", "1", static_cast<double>(x.count));
      figure(x.rays.c_str(), x.engine, x.name, "hits", "1", static_cast<double>(x.hits));
      if (x.speedup > 0) figure(x.rays.c_str(), x.engine, x.name, "speedup over best Embree", "1", x.speedup);
    }
    for (const BuildResult& b : r.builds) {
      const auto times = [&](const std::string& what, const Timing& t) {
        row("build", b.engine, b.name, what, "s", t.median(), t.least(), t.most(), t.seconds.size());
      };
      times("total", b.total);
      for (const BuildResult::Phase& phase : b.phases) times(phase.name, phase.timing);
    }
    for (const SplitResult& x : r.splits) {
      const std::string name = std::string(x.is_sah ? "SAH" : "median") + (x.on_host ? " host" : " device");
      figure("split", "rbvh", name, "nodes", "1", static_cast<double>(x.nodes));
      row("split", "rbvh", name, "build", "s", x.build.total.median(), x.build.total.least(),
          x.build.total.most(), x.build.total.seconds.size());
      for (const BuildResult::Phase& phase : x.build.phases)
        row("split", "rbvh", name, phase.name, "s", phase.timing.median(), phase.timing.least(),
            phase.timing.most(), phase.timing.seconds.size());
      for (const auto& [what, rays] : {std::pair{"primary", &x.primary}, std::pair{"diffuse", &x.diffuse}})
        if (rays->count > 0) figure("split", "rbvh", name, what, "Mrays/s", rays->mrays());
    }
    for (const MemoryResult& m : r.memory) {
      figure("memory", m.engine, m.name, "tree", "bytes", static_cast<double>(m.tree));
      figure("memory", m.engine, m.name, "geometry", "bytes", static_cast<double>(m.geometry));
    }
  }
  return out;
}

std::string json(const std::vector<Report>& reports) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const Report& r : reports) {
    nlohmann::ordered_json j = {{"scan", r.scan},
                                {"version", r.version},
                                {"device", r.device},
                                {"driver", r.driver},
                                {"embree", r.embree},
                                {"triangles", r.triangles},
                                {"points", r.points},
                                {"threads", r.threads},
                                {"repetitions", r.repetitions},
                                {"resolution", r.resolution}};
    for (const LevelResult& l : r.levels) {
      j["levels"].push_back({{"name", l.name},
                             {"rho", l.rho},
                             {"alpha", l.alpha},
                             {"phi_degrees", l.phi_degrees},
                             {"nodes", l.nodes},
                             {"leaves", l.leaves},
                             {"texels", l.texels},
                             {"texels_used", l.texels_used}});
    }
    for (const RaysResult& x : r.rays) {
      j["rays"].push_back({{"rays", x.rays},
                           {"engine", x.engine},
                           {"name", x.name},
                           {"count", x.count},
                           {"hits", x.hits},
                           {"mrays_per_second", x.mrays()},
                           {"speedup_over_best_embree", x.speedup},
                           {"seconds", timing_json(x.timing)}});
    }
    for (const BuildResult& b : r.builds) {
      nlohmann::ordered_json build = {
          {"engine", b.engine}, {"name", b.name}, {"seconds", timing_json(b.total)}};
      for (const BuildResult::Phase& phase : b.phases)
        build["phases"][phase.name] = timing_json(phase.timing);
      j["builds"].push_back(build);
    }
    for (const SplitResult& x : r.splits) {
      nlohmann::ordered_json split = {{"split", x.is_sah ? "sah" : "median"},
                                      {"partition", x.on_host ? "host" : "device"},
                                      {"nodes", x.nodes},
                                      {"seconds", timing_json(x.build.total)}};
      for (const BuildResult::Phase& phase : x.build.phases)
        split["phases"][phase.name] = timing_json(phase.timing);
      for (const auto& [what, rays] : {std::pair{"primary", &x.primary}, std::pair{"diffuse", &x.diffuse}})
        if (rays->count > 0)
          split[what] = {{"mrays_per_second", rays->mrays()}, {"seconds", timing_json(rays->timing)}};
      j["splits"].push_back(split);
    }
    for (const MemoryResult& m : r.memory) {
      j["memory"].push_back(
          {{"engine", m.engine}, {"name", m.name}, {"tree", m.tree}, {"geometry", m.geometry}});
    }
    all.push_back(j);
  }
  return all.dump(2) + "\n";
}

void write_report(const std::string& path, const std::string& text) {
  if (path.empty()) return;
  OutputFile file(path, true);
  file.write(text);
  file.commit();
}

}  // namespace rbvh::bench
