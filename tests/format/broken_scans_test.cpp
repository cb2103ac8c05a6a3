// The corpus of data/broken, by the tool itself and, cut and damaged further, by every reader.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "io/gltf.h"
#include "io/las.h"
#include "io/obj.h"
#include "io/off.h"
#include "io/pcd.h"
#include "io/ply.h"
#include "io/ptx.h"
#include "io/scan_io.h"
#include "io/stl.h"
#include "io/xyz.h"
#include "tests/fuzz/scan_target.h"
#include "tests/property.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

std::string content(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::vector<fs::path> corpus() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(RBVH_DATA "/broken")) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("bad_") || name.starts_with("ok_")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

void feed_all_readers(const std::string& bytes) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  check_reader(read_ply, "a.ply", data, bytes.size());
  check_reader(read_obj, "a.obj", data, bytes.size());
  check_reader(read_stl, "a.stl", data, bytes.size());
  check_reader(read_off, "a.off", data, bytes.size());
  check_reader(read_pcd, "a.pcd", data, bytes.size());
  check_reader(read_ptx, "a.ptx", data, bytes.size());
  check_reader(read_las, "a.las", data, bytes.size());
  check_reader(read_gltf, "a.glb", data, bytes.size(), 1 << 20);
  check_reader(read_xyz, "a.xyz", data, bytes.size());
}

TEST(BrokenScans, TheToolSaysOneLineAndLeavesNothing) {
  std::string pattern = (fs::temp_directory_path() / "rbvh broken XXXXXX").string();
  ASSERT_NE(mkdtemp(pattern.data()), nullptr);
  const fs::path folder = pattern;
  const fs::path out = folder / "out.ply", said = folder / "said";
  std::size_t bad = 0, good = 0;
  const std::vector<fs::path> files = corpus();
  // Every third: starting the tool takes a quarter of a second. The readers get all of them below.
  for (std::size_t i = 0; i < files.size(); i += 3) {
    const fs::path& file = files[i];
    SCOPED_TRACE(file.filename());
    const std::string command = std::string("'" RBVH_TOOL "' ingest '") + file.string() + "' -q -o '" +
                                out.string() + "' >'" + said.string() + "' 2>&1";
    const int status = std::system(command.c_str());
    ASSERT_TRUE(WIFEXITED(status));
    const std::string text = content(said);
    if (file.filename().string().starts_with("bad_")) {
      ++bad;
      EXPECT_EQ(WEXITSTATUS(status), 3);
      EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
      EXPECT_TRUE(text.starts_with("rbvh ingest: " + file.string() + ": ")) << text;
      EXPECT_FALSE(fs::exists(out));
    } else {
      ++good;
      EXPECT_EQ(WEXITSTATUS(status), 0);
      EXPECT_EQ(text, "");
      EXPECT_TRUE(fs::exists(out));
      fs::remove(out);
    }
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);  // what it said
  }
  fs::remove_all(folder);
  EXPECT_GT(bad, 30u);
  EXPECT_GT(good, 5u);
}

TEST(BrokenScans, CutAnywhereEveryReaderHolds) {
  for (const fs::path& file : corpus()) {
    const std::string bytes = content(file);
    for (std::size_t size = 0; size <= bytes.size(); ++size) feed_all_readers(bytes.substr(0, size));
  }
}

TEST(BrokenScans, DamagedAtRandomEveryReaderHolds) {
  std::mt19937_64 random(property_seed());
  const auto below = [&](std::size_t count) { return static_cast<std::size_t>(random() % count); };
  const std::string tokens[] = {
      "4294967295", "-1", "nan", "1e999", " ", "\n", "\r", "0", std::string(1, '\0'), "99999999999999999999"};
  for (const fs::path& file : corpus()) {
    const std::string bytes = content(file);
    if (bytes.empty()) continue;
    for (int trial = 0; trial < 200; ++trial) {
      std::string damaged = bytes;
      for (std::size_t change = 0; change <= below(3); ++change) {
        const std::size_t at = below(damaged.size());
        if (below(2) == 0) {
          damaged[at] = static_cast<char>(random());
        } else {
          damaged.replace(at, below(4), tokens[below(std::size(tokens))]);
        }
      }
      feed_all_readers(damaged);
    }
  }
}

}  // namespace
}  // namespace rbvh
