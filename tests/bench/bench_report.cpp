#include "tests/bench/bench_report.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace rbvh::bench {
namespace {

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

template <class... Args>
std::string format(const char* pattern, Args... args) {
  char text[512];
  std::snprintf(text, sizeof text, pattern, args...);
  return text;
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

const BuildResult* find_build(const Report& report, const std::string& engine, const std::string& name) {
  for (const BuildResult& b : report.builds) {
    if (b.engine == engine && b.name == name) return &b;
  }
  return nullptr;
}

std::string primitives(const Report& r) {
  const bool cloud = r.triangles == 0;
  const auto count = static_cast<double>(cloud ? r.points : r.triangles);
  return (count >= 1e6 ? format("%.2f M", count * 1e-6) : format("%.0f k", count * 1e-3)) +
         (cloud ? " discs" : " tris");
}

std::string milliseconds(const BuildResult* build) {
  return build != nullptr ? format("%.0f", build->total.median() * 1e3) : "-";
}

std::string megabytes(std::size_t bytes) { return format("%.2f", static_cast<double>(bytes) * 1e-6); }

void table_1(const std::vector<Report>& reports, std::string& out) {
  out +=
      "\nTable 1: nodes, build time and tracing (million rays per second) by level\n\n"
      "| Scene | Level | Nodes | Leaves | Texels | Used | Build [ms] | Primary | Diffuse |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Report& r : reports) {
    for (const LevelResult& level : r.levels) {
      const RaysResult* primary = find_rays(r, "primary", "rbvh", level.name);
      const RaysResult* diffuse = find_rays(r, "diffuse", "rbvh", level.name);
      out += format("| %s (%s) | %s | %zu | %zu | %zu | %.0f%% | %s | %.2f | %.2f |\n", r.scan.c_str(),
                    primitives(r).c_str(), level.name.c_str(), level.nodes, level.leaves, level.texels,
                    100.0 * static_cast<double>(level.texels_used) /
                        static_cast<double>(std::max<std::size_t>(1, level.texels)),
                    milliseconds(find_build(r, "rbvh", level.name)).c_str(), primary ? primary->mrays() : 0.0,
                    diffuse ? diffuse->mrays() : 0.0);
    }
  }
}

void table_2(const std::vector<Report>& reports, std::string& out) {
  for (const std::string rays : {"primary", "diffuse"}) {
    out += "\nTable 2: " + rays +
           " rays, million per second; speedup over Embree's best (median of ratios)\n\n| Scene | Primitives "
           "| Embree's best | Exact |";
    std::string line = "| --- | --- | --- | --- |";
    for (const LevelResult& level : reports.front().levels) {
      out += " " + level.name + " |";
      line += " --- |";
    }
    out += " Speedup |\n" + line + " --- |\n";
    for (const Report& r : reports) {
      const RaysResult* embree = best_embree(r, rays);
      const RaysResult* exact = find_rays(r, rays, "exact", {});
      out += format("| %s | %s | %s | %.2f |", r.scan.c_str(), primitives(r).c_str(),
                    embree ? format("%.2f (%s)", embree->mrays(), embree->name.c_str()).c_str() : "-",
                    exact ? exact->mrays() : 0.0);
      std::string speedups;
      for (const LevelResult& level : r.levels) {
        const RaysResult* traced = find_rays(r, rays, "rbvh", level.name);
        out += traced ? format(" %.2f |", traced->mrays()) : " - |";
        if (traced && embree) speedups += (speedups.empty() ? "" : ", ") + format("%.2f", traced->speedup);
      }
      out += " " + (speedups.empty() ? "-" : speedups) + " |\n";
    }
  }
}

void table_3(const std::vector<Report>& reports, std::string& out) {
  out +=
      "\nTable 3: memory in megabytes: tree + geometry (triangles or atlas) = total\n\n"
      "| Scene | Structure | Tree | Geometry | Total | of Embree MEDIUM |\n| --- | --- | --- | --- | --- | "
      "--- |\n";
  for (const Report& r : reports) {
    double whole = 0;
    for (const MemoryResult& m : r.memory) {
      if (m.engine == "embree" && whole == 0) whole = static_cast<double>(m.total());
    }
    for (const MemoryResult& m : r.memory) {
      out +=
          format("| %s | %s %s | %s | %s | %s | %s |\n", r.scan.c_str(), m.engine.c_str(), m.name.c_str(),
                 megabytes(m.tree).c_str(), megabytes(m.geometry).c_str(), megabytes(m.total()).c_str(),
                 whole > 0 ? format("%.1f%%", 100.0 * static_cast<double>(m.total()) / whole).c_str() : "-");
    }
  }
}

void table_4(const std::vector<Report>& reports, std::string& out) {
  out +=
      "\nTable 4: build times in milliseconds (medians)\n\n| Scene | Structure | Total | Phases |\n| --- | "
      "--- | --- | --- |\n";
  for (const Report& r : reports) {
    for (const BuildResult& b : r.builds) {
      std::string phases;
      for (const BuildResult::Phase& phase : b.phases) {
        phases +=
            (phases.empty() ? "" : ", ") + format("%s %.0f", phase.name.c_str(), phase.timing.median() * 1e3);
      }
      out += format("| %s | %s %s | %.0f | %s |\n", r.scan.c_str(), b.engine.c_str(), b.name.c_str(),
                    b.total.median() * 1e3, phases.c_str());
    }
  }
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

std::string markdown(const std::vector<Report>& reports) {
  std::string out;
  if (reports.empty()) return out;
  const Report& r = reports.front();
  out += format("rbvh %s on %s; %s; %d threads; %u x %u primary rays; %d interleaved repetitions, medians\n",
                r.version.c_str(), r.device.c_str(),
                r.embree.empty() ? "without Embree" : ("Embree " + r.embree).c_str(), r.threads, r.resolution,
                r.resolution, r.repetitions);
  table_1(reports, out);
  table_2(reports, out);
  table_3(reports, out);
  table_4(reports, out);
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
    for (const MemoryResult& m : r.memory) {
      j["memory"].push_back(
          {{"engine", m.engine}, {"name", m.name}, {"tree", m.tree}, {"geometry", m.geometry}});
    }
    all.push_back(j);
  }
  return all.dump(2) + "\n";
}

}  // namespace rbvh::bench
