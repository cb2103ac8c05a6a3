// Outputs are whole or absent, on every way out. Root may write anywhere, so what cannot be written is shown
// by full devices, paths below files and size limits.
#include "io/output_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <thread>
#include <vector>

#include "io/interrupts.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {
namespace fs = std::filesystem;

class OutputFileTest : public testing::Test {
 protected:
  OutputFileTest() {
    std::string pattern = (fs::temp_directory_path() / "rbvh_output_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  ~OutputFileTest() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  static std::string content(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  // The one line it fails with.
  static std::string failure(const std::function<void()>& body) {
    try {
      body();
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kFailure);
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return {};
  }
  static void write_all(const std::string& path, std::string_view text, bool overwrite) {
    OutputFile file(path, overwrite);
    file.write(text);
    file.commit();
  }
  // Runs `body` in a child and returns how that ended.
  static int in_child(const std::function<void()>& body) {
    const pid_t child = fork();
    if (child == 0) {
      body();
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return status;
  }

  fs::path folder_;
};

TEST_F(OutputFileTest, AppearsOnlyWhenCommitted) {
  {
    OutputFile file(path("scan.atlas.tif"), false);
    EXPECT_EQ(fs::path(file.temporary_path()).filename().string(), ".scan.atlas.rbvh-tmp.tif");
    file.write("wh");
    file.write("ole");
    EXPECT_FALSE(fs::exists(path("scan.atlas.tif")));
    file.commit();
    EXPECT_EQ(content(path("scan.atlas.tif")), "whole");
  }
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, UncommittedLeavesNothing) {
  { OutputFile(path("a.png"), false).write("half"); }
  EXPECT_EQ(files(), 0u);
}

TEST_F(OutputFileTest, OverwritesOnlyWhenAsked) {
  write_all(path("a"), "old", false);
  EXPECT_NE(failure([&] { OutputFile(path("a"), false); }).find("exists"), std::string::npos);
  EXPECT_NE(failure([&] { check_output(path("a"), false); }).find("exists"), std::string::npos);
  EXPECT_EQ(content(path("a")), "old");
  chmod(path("a").c_str(), 0640);
  write_all(path("a"), "new", true);
  EXPECT_EQ(content(path("a")), "new");
  struct stat status {};
  stat(path("a").c_str(), &status);
  EXPECT_EQ(status.st_mode & 0777u, 0640u);
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, DoesNotReplaceWhatAppearedMeanwhile) {
  OutputFile file(path("a"), false);
  file.write("mine");
  std::ofstream(path("a")) << "theirs";
  EXPECT_NE(failure([&] { file.commit(); }).find("exists"), std::string::npos);
  EXPECT_EQ(content(path("a")), "theirs");
}

TEST_F(OutputFileTest, FollowsLinks) {
  std::ofstream(path("real")) << "old";
  fs::create_symlink(path("real"), path("link"));
  write_all(path("link"), "new", true);
  EXPECT_TRUE(fs::is_symlink(path("link")));
  EXPECT_EQ(content(path("real")), "new");
}

TEST_F(OutputFileTest, RefusesWhatCannotBe) {
  std::ofstream(path("file")) << "x";
  EXPECT_NE(failure([&] { check_output(path("file/below.png"), false); }).find("no folder"),
            std::string::npos);
  EXPECT_NE(failure([&] { check_output(path("missing/a.png"), false); }).find("make it first"),
            std::string::npos);
  EXPECT_NE(failure([&] { check_output(folder_.string(), true); }).find("is a folder"), std::string::npos);
  failure([&] { check_output("", true); });
  failure([&] { check_output(path(std::string(300, 'x')), true); });
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, LongNamesStillFit) {
  const std::string name = std::string(NAME_MAX - 4, 'n') + ".png";
  write_all(path(name), "x", false);
  EXPECT_EQ(content(path(name)), "x");
}

TEST_F(OutputFileTest, StaleTemporaryFilesAreInNobodysWay) {
  std::string stale;
  {
    const OutputFile file(path("a.png"), false);
    stale = file.temporary_path();
  }
  fs::create_symlink(path("elsewhere"), stale);
  write_all(path("a.png"), "x", false);
  EXPECT_EQ(content(path("a.png")), "x");
  EXPECT_FALSE(fs::exists(path("elsewhere")));
}

TEST_F(OutputFileTest, FullDevice) {
  check_output("/dev/full", false);
  EXPECT_NE(failure([&] { write_all("/dev/full", "x", false); }).find("No space"), std::string::npos);
  write_all("/dev/null", "x", false);
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(OutputFileTest, PipesGetTheBytes) {
  const std::string fifo = path("fifo");
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  std::string got;
  std::thread reader([&] { got = content(fifo); });
  write_all(fifo, std::string(200000, 'p'), false);
  reader.join();
  EXPECT_EQ(got, std::string(200000, 'p'));
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, StandardOutput) {
  const std::string target = path("stdout");
  for (const char* name : {"-", "/dev/stdout"}) {
    const int status = in_child([&] {
      if (std::freopen(target.c_str(), "wb", stdout) == nullptr) _exit(9);
      write_all(name, "data", false);
    });
    EXPECT_EQ(status, 0) << name;
    EXPECT_EQ(content(target), "data") << name;
  }
}

TEST_F(OutputFileTest, BrokenPipeIsAnError) {
  const int status = in_child([&] {
    install_interrupt_cleanup();
    int ends[2];
    if (pipe(ends) != 0) _exit(9);
    close(ends[0]);
    dup2(ends[1], STDOUT_FILENO);
    try {
      write_all("-", "x", false);
    } catch (const Error& error) {
      _exit(std::string(error.what()).find("Broken pipe") != std::string::npos ? 1 : 8);
    }
  });
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
}

TEST_F(OutputFileTest, SizeLimitIsAnError) {
  const int status = in_child([&] {
    install_interrupt_cleanup();
    const rlimit limit{1000, 1000};
    setrlimit(RLIMIT_FSIZE, &limit);
    try {
      write_all(path("a"), std::string(5000, 'x'), false);
    } catch (const Error& error) {
      _exit(std::string(error.what()).find("too large") != std::string::npos ? 1 : 8);
    }
  });
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_EQ(files(), 0u);
}

TEST_F(OutputFileTest, InterruptRemovesWhatIsUnfinished) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const int status = in_child([&] {
      install_interrupt_cleanup();
      OutputFile first(path("a.rbvh"), true), second(path("a.atlas.tif"), true);
      first.write("half");
      raise(signal);
    });
    ASSERT_TRUE(WIFEXITED(status)) << signal;
    EXPECT_EQ(WEXITSTATUS(status), 130) << signal;
    EXPECT_EQ(files(), 0u) << signal;
  }
}

TEST_F(OutputFileTest, ALibrarysExitRemovesWhatIsUnfinished) {
  const int status = in_child([&] {
    install_interrupt_cleanup();
    OutputFile file(path("a"), true);
    file.write("half");
    exit(7);
  });
  EXPECT_EQ(WEXITSTATUS(status), 7);
  EXPECT_EQ(files(), 0u);
}

// Each leaves one file, and not even that where it wrote to a device or a pipe.
TEST_F(OutputFileTest, TheNextWriterRemovesWhatKilledOnesLeft) {
  for (const std::string& name : {std::string("a.png"), std::string(NAME_MAX - 4, 'n') + ".png"}) {
    for (std::size_t killed = 0; killed < 3; ++killed) {
      const pid_t child = fork();
      if (child == 0) {
        std::vector<std::unique_ptr<OutputFile>> files;
        for (std::size_t i = 0; i <= killed; ++i)
          files.push_back(std::make_unique<OutputFile>(path(name), false));
        for (const auto& file : files) file->write("half");
        raise(SIGKILL);
      }
      waitpid(child, nullptr, 0);
      EXPECT_EQ(files(), killed + 1);
      const OutputFile alive(path(name), false);  // its file is not abandoned
      write_all(path(name), "whole", false);
      EXPECT_EQ(files(), 2u);
      fs::remove(path(name));
    }
    EXPECT_EQ(files(), 0u);
  }
  setenv("TMPDIR", folder_.c_str(), 1);
  EXPECT_EQ(in_child([&] {
              const OutputFile file("/dev/null", false);
              raise(SIGKILL);
            }),
            SIGKILL);
  unsetenv("TMPDIR");
  EXPECT_EQ(files(), 0u);
}

// Threads that write without pause are interrupted at arbitrary moments: never a temporary file, never half a
// file.
TEST_F(OutputFileTest, InterruptAtAnyMoment) {
  const std::string whole(5000, 'w');
  for (int run = 0; run < 40; ++run) {
    const pid_t child = fork();
    if (child == 0) {
      install_interrupt_cleanup();
      std::vector<std::thread> threads;
      for (const char* name : {"a", "b", "c"})
        threads.emplace_back([&, name] {
          for (;;) write_all(path(name), whole, true);
        });
      for (std::thread& thread : threads) thread.join();
    }
    usleep(static_cast<useconds_t>(2000 + run * 137));
    kill(child, SIGINT);
    int status = 0;
    waitpid(child, &status, 0);
    // Before the handlers are there, the signal itself ends the child.
    ASSERT_TRUE((WIFEXITED(status) && WEXITSTATUS(status) == 130) ||
                (WIFSIGNALED(status) && WTERMSIG(status) == SIGINT));
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
      EXPECT_NE(entry.path().filename().string().front(), '.');
      EXPECT_EQ(content(entry.path().string()), whole);
    }
  }
}

}  // namespace
}  // namespace rbvh
