// Odd surroundings of the tool: caches and folders that cannot be written, limits, closed streams, names.
#include <unistd.h>

#include <chrono>
#include <cstdlib>

#include "tests/run_tool.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

class Surroundings : public ToolTest {
 protected:
  void SetUp() override {
    ToolTest::SetUp();
    write("a.ply", ball_ply(4));
    fs::create_directory(path("tmp"));
  }
  std::string cache() const { return path("tmp/rbvh-kernels-" + std::to_string(geteuid())); }
  static constexpr const char* kRender = "render a.ply -o a.png --resolution 8,8 -f -q";
};

// A home that cannot be written, in each of the places where PoCL keeps kernels.
TEST_F(Surroundings, KernelsAreKeptInTheTemporaryFolderWhereTheCacheCannotBeWritten) {
  // Saves the time to compile. Other tests write there meanwhile: what cannot be copied is compiled.
  std::error_code code;
  if (const char* warm = std::getenv("POCL_CACHE_DIR"); warm != nullptr && fs::exists(warm))
    fs::copy(warm, cache(), fs::copy_options::recursive, code);
  if (fs::exists(cache())) fs::permissions(cache(), fs::perms::owner_all);
  const std::string temporary = "TMPDIR='" + path("tmp") + "' ";
  for (const std::string where : {"POCL_CACHE_DIR=/proc/no", "POCL_CACHE_DIR= XDG_CACHE_HOME=/proc/no",
                                  "POCL_CACHE_DIR= XDG_CACHE_HOME= HOME=/proc/no"}) {
    const ToolRun run = tool(kRender, temporary + where);
    EXPECT_EQ(run.code, 0) << where << run.err;
    EXPECT_EQ(run.err, "") << where;
    EXPECT_TRUE(fs::exists(cache())) << where;
    EXPECT_EQ(fs::status(cache()).permissions(), fs::perms::owner_all) << where;
  }
  // Kernels are run: a folder that others can write to is not taken.
  fs::remove_all(cache());
  fs::create_directory(cache());
  fs::permissions(cache(), fs::perms::all);
  EXPECT_EQ(tool("devices", temporary + "POCL_CACHE_DIR=/proc/no").code, 0);
  EXPECT_TRUE(fs::is_empty(cache()));
}

TEST_F(Surroundings, WhatPoclLeavesInItsCacheGoes) {
  const std::string folder = path("cache");
  fs::create_directory(folder);
  write("cache/tempfile_aaaaaa", "");
  write("cache/tempfile_young.cl", "of a run that compiles");
  write("cache/tempfile_old.cl", "of a run that was killed");
  write("cache/other", "");
  fs::last_write_time(folder + "/tempfile_old.cl", fs::file_time_type::clock::now() - std::chrono::hours(2));
  EXPECT_EQ(tool("devices", "POCL_CACHE_DIR='" + folder + "'").code, 0);
  std::string left;
  for (const char* name : {"other", "tempfile_aaaaaa", "tempfile_old.cl", "tempfile_young.cl"})
    if (exists(std::string("cache/") + name)) left += std::string(name) + " ";
  EXPECT_EQ(left, "other tempfile_young.cl ");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 2) << files();
}

// LLVM would end the process with a line of its own.
TEST_F(Surroundings, TooLowALimitOnFilesIsSaidBeforeKernelsAreCompiled) {
  const ToolRun run = tool(kRender, "prlimit --fsize=100000:");
  EXPECT_EQ(run.code, 6);
  EXPECT_EQ(run.lines(), 1) << run.err;
  EXPECT_NE(run.err.find("ulimit -f"), std::string::npos) << run.err;
  EXPECT_FALSE(exists("a.png"));
}

TEST_F(Surroundings, ReportsAndLogsThatCannotBeWrittenAreOneLine) {
  const std::string words = "ingest a.ply -o b.ply ";
  for (const char* option : {"--report /proc/no", "--report tmp", "--report /proc/no/r", "--log /proc/no",
                             "--log tmp", "--log /proc/no/l", "--log new.log --report tmp"})
    bad(words + option, 1, "rbvh ingest: ");
  EXPECT_EQ(tool(words + "--log new.log --report r.json -q").code, 0);
  EXPECT_TRUE(exists("new.log") && exists("r.json"));
}

TEST_F(Surroundings, NoTemporaryFolder) {
  const ToolRun run = tool("ingest a.ply -o - -q", "TMPDIR=/proc/no");
  EXPECT_EQ(run.code, 0) << run.err;
  good("ingest a.ply -o b.ply");
  EXPECT_EQ(run.out, read("b.ply"));
}

TEST_F(Surroundings, ClosedStreams) {
  EXPECT_EQ(tool("ingest a.ply -o b.ply < /dev/null <&- 2>&- >&-").code, 0);
  EXPECT_EQ(files(), "a.ply b.ply tmp");
  bad("ingest - -o c.ply <&-", 3, "standard input");
  EXPECT_EQ(tool("ingest a.ply -o - -q >&-").code, 1);
}

TEST_F(Surroundings, AnyNameAFileMayHave) {
  for (const std::string& name :
       {std::string("a\nb.ply"), std::string("-o.ply"), std::string("\xff\xfe.ply"), std::string(" .ply"),
        std::string("$(x)`.ply"), std::string(251, 'n') + ".ply"}) {
    const std::string quoted = "\"$(cat name)\"";
    write("name", "./" + name);
    const ToolRun run = tool("ingest a.ply -o " + quoted);
    EXPECT_EQ(run.code, 0) << name << run.err;
    EXPECT_EQ(run.lines(), 2) << run.err;  // what it holds, and what is removed
    EXPECT_TRUE(exists(name)) << files();
    EXPECT_EQ(tool("info --json " + quoted).code, 0) << name;
    fs::remove(path(name));
  }
  write("name", std::string(252, 'n') + ".ply");
  bad("ingest a.ply -o \"$(cat name)\"", 1, "too long");
  bad("ingest a.ply -o tmp", 1, "is a folder");
}

}  // namespace
}  // namespace rbvh
