// A pair is written whole or not at all, whatever happens meanwhile.
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <optional>

#include "io/interrupts.h"
#include "pipeline/base/parallel_for.h"
#include "tests/format/pair_test.h"

namespace rbvh {
namespace {

using RbvhWriteTest = RbvhFileTest;

TEST_F(RbvhWriteTest, ReplacesOnlyWhenAsked) {
  write_rbvh(path("a.rbvh"), make_small_rbvh(0), false);
  EXPECT_THROW(write_rbvh(path("a.rbvh"), make_small_rbvh(1), false), Error);
  EXPECT_THROW(check_rbvh_output(path("a.rbvh"), false), Error);
  expect_equal(make_small_rbvh(0), read_rbvh(path("a.rbvh")));
  fs::remove(path("a.rbvh"));
  EXPECT_THROW(write_rbvh(path("a.rbvh"), make_small_rbvh(1), false), Error);  // the atlas is somebody's, too
  EXPECT_EQ(files(), 1u);
  check_rbvh_output(path("a.rbvh"), true);
  write_rbvh(path("a.rbvh"), make_small_rbvh(1), true);
  expect_equal(make_small_rbvh(1), read_rbvh(path("a.rbvh")));
  EXPECT_EQ(files(), 2u);
}

// Every size limit below what is needed ends in one error and no file.
TEST_F(RbvhWriteTest, SizeLimits) {
  const Rbvh rbvh = make_small_rbvh();
  const RbvhBytes whole = write_rbvh(path("a.rbvh"), rbvh, false);
  fs::remove(path("a.rbvh"));
  fs::remove(path("a.atlas.tif"));
  const std::uint64_t needed = std::max(whole.hierarchy, whole.atlas);
  for (std::uint64_t limit = 0; limit <= needed; limit += limit + 64 < needed ? 37 : 1) {
    const pid_t child = fork();
    if (child == 0) {
      set_thread_count(1);  // a fork has none of its parent's pools
      install_interrupt_cleanup();
      const rlimit bound{limit, limit};
      setrlimit(RLIMIT_FSIZE, &bound);
      try {
        write_rbvh(path("a.rbvh"), rbvh, false);
      } catch (const Error& error) {
        const std::string what = error.what();
        _exit(error.kind() == ErrorKind::kFailure && what.find('\n') == std::string::npos ? 1 : 8);
      }
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status)) << limit;
    ASSERT_EQ(WEXITSTATUS(status), limit < needed ? 1 : 0) << limit;
    ASSERT_EQ(files(), limit < needed ? 0u : 2u) << limit;
  }
}

TEST_F(RbvhWriteTest, PairsNeedAFolder) {
  const auto failure =
      [&](const std::function<void()>& body) -> std::pair<std::optional<ErrorKind>, std::string> {
    try {
      body();
    } catch (const Error& error) {
      return {error.kind(), error.what()};
    }
    return {std::nullopt, ""};
  };
  const Rbvh rbvh = make_small_rbvh();
  expect_contains(failure([&] { write_rbvh("/dev/full", rbvh, true); }).second, "no regular file");
  EXPECT_EQ(failure([&] { check_rbvh_output("/dev/full", true); }).first, ErrorKind::kFailure);
  EXPECT_FALSE(fs::exists("/dev/full.atlas.tif"));
  EXPECT_EQ(failure([&] { check_rbvh_output("-", true); }).first, ErrorKind::kUsage);
  EXPECT_EQ(failure([&] { check_rbvh_output(path("none/a.rbvh"), true); }).first, ErrorKind::kFailure);
  EXPECT_EQ(failure([&] { read_rbvh("-"); }).first, ErrorKind::kInput);
  EXPECT_EQ(failure([&] { read_rbvh(folder_.string()); }).first, ErrorKind::kInput);
  EXPECT_EQ(files(), 0u);
}

TEST_F(RbvhWriteTest, NothingIsWrittenOverTheBytesAllowed) {
  const Rbvh rbvh = make_layered_rbvh();
  const RbvhBytes over = write_rbvh(path("a.rbvh"), rbvh, false, 100);
  EXPECT_EQ(files(), 0u);
  const RbvhBytes written = write_rbvh(path("a.rbvh"), rbvh, false, over.hierarchy + over.atlas);
  EXPECT_EQ(files(), 2u);
  EXPECT_EQ(written.hierarchy, fs::file_size(path("a.rbvh")));
  EXPECT_EQ(written.atlas, fs::file_size(path("a.atlas.tif")));
  EXPECT_EQ(written.hierarchy, over.hierarchy);
}

}  // namespace
}  // namespace rbvh
