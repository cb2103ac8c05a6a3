// Runs the real binary in a folder of its own, for tests of the command line.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace rbvh {

struct ToolRun {
  int code = -1;
  std::string out, err;

  /// Of stderr.
  std::ptrdiff_t lines() const { return std::count(err.begin(), err.end(), '\n'); }
};

class ToolTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "rbvh_test_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  /// `words` go through the shell, in the test's folder; `before` may set variables or redirect.
  ToolRun tool(const std::string& words, const std::string& before = {}) const {
    return shell(before + " '" RBVH_TOOL "' " + words);
  }
  ToolRun shell(const std::string& command) const {
    const std::string out = path(".out"), err = path(".err");
    const int status = std::system(
        ("cd '" + folder_.string() + "' && { " + command + " ; } > '" + out + "' 2> '" + err + "'").c_str());
    ToolRun run{WIFEXITED(status) ? WEXITSTATUS(status) : 128, read(".out"), read(".err")};
    std::filesystem::remove(out);
    std::filesystem::remove(err);
    return run;
  }
  /// Succeeds, with nothing on stderr.
  void good(const std::string& words) const {
    const ToolRun run = tool(words + " -q");
    EXPECT_EQ(run.code, 0) << words << "\n" << run.err;
    EXPECT_EQ(run.err, "") << words;
  }
  /// Fails with one line that has `part`, and leaves nothing.
  void bad(const std::string& words, int code, const std::string& part) const {
    const std::string before = files();
    const ToolRun run = tool(words + " -q");
    EXPECT_EQ(run.code, code) << words << "\n" << run.err;
    EXPECT_EQ(run.lines(), 1) << words << "\n" << run.err;
    EXPECT_NE(run.err.find(part), std::string::npos) << run.err << " lacks " << part;
    EXPECT_EQ(files(), before) << words;
  }
  std::string read(const std::string& name) const {
    std::ifstream in(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::string& name, const std::string& content) const {
    std::ofstream(path(name), std::ios::binary) << content;
  }
  bool exists(const std::string& name) const { return std::filesystem::exists(path(name)); }
  /// The names in the folder, sorted, with spaces between.
  std::string files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_))
      names.push_back(std::filesystem::relative(entry.path(), folder_).string());
    std::sort(names.begin(), names.end());
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : " ") + name;
    return all;
  }

  std::filesystem::path folder_;
};

/// A bumpy ball as an ASCII PLY mesh: `rings` x 2 `rings` quads, two triangles each.
inline std::string ball_ply(int rings) {
  const int around = 2 * rings;
  std::string vertices, faces;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j < around; ++j) {
      const double polar = M_PI * i / rings, turn = 2 * M_PI * j / around;
      const double r = 1 + 0.05 * std::sin(6 * turn) * std::sin(5 * polar);
      char line[96];
      std::snprintf(line, sizeof line, "%.7g %.7g %.7g\n", r * std::sin(polar) * std::cos(turn),
                    r * std::cos(polar), -r * std::sin(polar) * std::sin(turn));
      vertices += line;
    }
  int count = 0;
  const auto face = [&](int a, int b, int c) {
    faces += "3 " + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(c) + "\n";
    ++count;
  };
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < around; ++j) {
      const int a = i * around + j, b = i * around + (j + 1) % around, c = a + around, d = b + around;
      if (i > 0) face(a, c, b);
      if (i + 1 < rings) face(b, c, d);
    }
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string((rings + 1) * around) +
         "\nproperty float x\nproperty float y\nproperty float z\nelement face " + std::to_string(count) +
         "\nproperty list uchar int vertex_indices\nend_header\n" + vertices + faces;
}

}  // namespace rbvh
