// What was measured, and how it is written down: tables like the paper's (Markdown), CSV with one row a
// figure, JSON.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace rbvh::bench {

/// printf() into a string.
template <class... Args>
std::string format(const char* pattern, Args... args) {
  char text[512];
  std::snprintf(text, sizeof text, pattern, args...);
  return text;
}

/// The same work, timed in every repetition.
struct Timing {
  std::vector<double> seconds;
  double median() const;
  double least() const;
  double most() const;
};

/// Median over the repetitions of a.seconds / b.seconds.
double median_ratio(const Timing& a, const Timing& b);

struct RaysResult {
  std::string rays;    ///< "primary" or "diffuse"
  std::string engine;  ///< "rbvh", "exact" or "embree"
  std::string name;    ///< level, or Embree's build and mode
  std::size_t count = 0, hits = 0;
  Timing timing;
  double speedup = 0;  ///< over Embree's best of the same rays; 0 without Embree
  double mrays() const { return static_cast<double>(count) / timing.median() * 1e-6; }
};

struct BuildResult {
  std::string engine, name;
  struct Phase {
    std::string name;
    Timing timing;
  };
  Timing total;
  std::vector<Phase> phases;
};

/// A row of the paper's table 1.
struct SplitResult {
  bool is_sah = false, on_host = false;
  std::size_t nodes = 0;
  BuildResult build;
  RaysResult primary, diffuse;
};

struct MemoryResult {
  std::string engine, name;
  std::size_t tree = 0, geometry = 0;  ///< bytes; Embree's own copy of the geometry counts as tree
  std::size_t total() const { return tree + geometry; }
};

struct LevelResult {
  std::string name;
  double rho = 0, alpha = 0, phi_degrees = 0;
  std::size_t nodes = 0, leaves = 0, texels = 0, texels_used = 0;
};

struct Report {
  std::string scan, version, device, driver, embree;
  std::size_t triangles = 0, points = 0;
  int threads = 0, repetitions = 0;
  std::uint32_t resolution = 0;
  std::vector<LevelResult> levels;
  std::vector<RaysResult> rays;
  std::vector<BuildResult> builds;
  std::vector<MemoryResult> memory;
  std::vector<SplitResult> splits;
};

/// Fills in every speedup, and returns the index of Embree's best in `report.rays` for those rays, or -1.
int compare_with_best(Report& report, const std::string& rays);

/// Those of the paper's tables 1 to 4, its figures beside ours.
std::string markdown(const std::vector<Report>& reports, const std::vector<int>& tables);
std::string csv(const std::vector<Report>& reports);
std::string json(const std::vector<Report>& reports);

/// Replaces the file; nothing where `path` is empty. Throws Error(kFailure).
void write_report(const std::string& path, const std::string& text);

}  // namespace rbvh::bench
