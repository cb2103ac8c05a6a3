// A disk that fills up while any output is written: exit 1, one line, the old file as it was, nothing left
// over.
#include <sys/mount.h>

#include <cerrno>
#include <cstring>
#include <map>

#include "io/npy.h"
#include "tests/run_tool.h"

namespace rbvh {
namespace {

class FullDisk : public ToolTest {
 protected:
  using Contents = std::map<std::string, std::string>;  // by file name

  void SetUp() override {
    ToolTest::SetUp();
    write("ball.ply", ball_ply(24));
    std::filesystem::create_directory(path("out"));
  }
  void TearDown() override {
    if (is_mounted_) ::umount(path("out").c_str());
    ToolTest::TearDown();
  }
  Contents outputs() const {
    Contents contents;
    for (const auto& entry : std::filesystem::directory_iterator(path("out")))
      contents[entry.path().filename().string()] = read("out/" + entry.path().filename().string());
    return contents;
  }
  void clear() const {
    for (const auto& entry : std::filesystem::directory_iterator(path("out")))
      std::filesystem::remove(entry.path());
  }
  /// What `words` write where there is space.
  Contents whole(const std::string& words) const {
    good(words);
    Contents contents = outputs();
    clear();
    return contents;
  }
  static std::size_t largest(const Contents& contents) {
    std::size_t bytes = 0;
    for (const auto& [name, content] : contents) bytes = std::max(bytes, content.size());
    return bytes;
  }
  /// Of several pictures, those before the disk was full may be there. `replaces`: old files are in the way.
  void expect_failure(const std::string& words, const std::string& before, const Contents& whole,
                      bool replaces) const {
    const std::string old = "old";
    if (replaces)
      for (const auto& [name, content] : whole) write("out/" + name, old);
    const ToolRun run = tool(words + (replaces ? " -f -q" : " -q"), before);
    EXPECT_EQ(run.code, 1) << before << words << "\n" << run.err;
    EXPECT_EQ(run.lines(), 1) << before << words << "\n" << run.err;
    const Contents now = outputs();
    for (const auto& [name, content] : now)
      EXPECT_TRUE(whole.contains(name) && (content == whole.at(name) || (replaces && content == old)))
          << before << words << ": " << name;
    EXPECT_TRUE(!replaces || now.size() == whole.size()) << before << words;
    clear();
  }
  /// A file system of `bytes` at out/.
  bool mount(std::size_t bytes) {
    const std::string size = "size=" + std::to_string(bytes);
    if (is_mounted_ && ::umount(path("out").c_str()) != 0) return false;
    is_mounted_ = ::mount("tmpfs", path("out").c_str(), "tmpfs", 0, size.c_str()) == 0;
    return is_mounted_;
  }

 private:
  bool is_mounted_ = false;
};

// No file grows past RLIMIT_FSIZE. Only for stages without a device: PoCL writes files of its own.
TEST_F(FullDisk, AtAnyByteOfAFile) {
  constexpr std::size_t kErrorLine = 300;  // goes to a file, too
  for (const std::string words :
       {"ingest ball.ply -o out/a.ply", "proxy ball.ply -o out/a.obj --patches 60"}) {
    const Contents contents = whole(words);
    for (const std::size_t bytes : {kErrorLine, largest(contents) / 2, largest(contents) - 1})
      for (const bool replaces : {false, true})
        expect_failure(words, "prlimit --fsize=" + std::to_string(bytes) + ":", contents, replaces);
  }
}

TEST_F(FullDisk, OfAFewPages) {
  constexpr std::size_t kPage = 4096;
  if (!mount(kPage)) GTEST_SKIP() << "no file system may be mounted here: " << std::strerror(errno);
  good("build ball.ply -o ball.rbvh");
  std::vector<float> rays;
  for (int i = 0; i < 1500; ++i)
    rays.insert(rays.end(), {static_cast<float>(i % 40 - 20) / 20, 0, 6, 0, 0, -1});
  write_npy(path("rays.npy"), rays, 6, false);
  for (const std::string words : {
           "render ball.rbvh -o out/a.png --resolution 160,160",
           "render ball.rbvh -o out/a.jpg --resolution 400,400",
           "render ball.rbvh -o out/a.exr --resolution 96,96",
           "render ball.rbvh -o 'out/{frame}.png' --turntable 3 --resolution 160,160",
           "validate ball.rbvh --against ball.ply --pictures out --views 2 --level Q4 --resolution 512",
           "trace ball.rbvh --rays rays.npy -o out/hits.npy",
           "build ball.ply -o out/a.rbvh",
           "lod ball.rbvh -o out/a.rbvh --levels Q1",
       }) {
    ASSERT_TRUE(mount(1 << 24));
    const Contents contents = whole(words);
    const std::size_t too_few = largest(contents) / kPage;
    ASSERT_GT(too_few, 0u) << words;
    ASSERT_TRUE(mount(too_few * kPage));
    expect_failure(words, "", contents, false);
    ASSERT_TRUE(mount((too_few + contents.size()) * kPage));
    expect_failure(words, "", contents, true);
  }
}

}  // namespace
}  // namespace rbvh
