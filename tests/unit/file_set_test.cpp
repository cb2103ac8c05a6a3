// Files that belong together: names, what a writer tidies and what it leaves alone, and how writers wait for
// each other. Replacing is in tests/format/replace_test.cpp.
#include "io/file_set.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <limits.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <set>
#include <thread>

#include "io/hash.h"
#include "io/interrupts.h"
#include "io/posix_file.h"
#include "pipeline/base/error.h"
#include "tests/output_warning.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

class FileSetTest : public testing::Test {
 protected:
  FileSetTest() {
    std::string pattern = (fs::temp_directory_path() / "rbvh_set_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  ~FileSetTest() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  void put(const std::string& name, const std::string& text) const { std::ofstream(path(name)) << text; }
  /// A file with the name that its content gives it beside `name`.
  std::string put_addressed(const std::string& name, const std::string& text) const {
    const std::string file = fs::path(addressed_path(name, hash_bytes(text))).filename().string();
    put(file, text);
    return file;
  }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_))
      names.insert(entry.path().filename().string());
    return names;
  }
  std::string write(const std::string& head_text, const std::string& part_text) const {
    OutputFile head(path("a.head"), true), part(path("a.part.x"), true, OutputFile::Role::kInSet);
    head.write(head_text);
    part.write(part_text);
    const SetPart parts[] = {{&part, hash_bytes(part_text)}};
    return output_warning([&] { commit_set(head, parts); });
  }

  fs::path folder_;
};

TEST_F(FileSetTest, Names) {
  EXPECT_EQ(addressed_path("x/a.atlas.tif", 0xabc), "x/a.atlas.0000000000000abc.tif");
  EXPECT_EQ(addressed_path("a.obj", UINT64_MAX), "a.ffffffffffffffff.obj");
  EXPECT_EQ(parse_addressed("x/a.atlas.0000000000000abc.tif")->path, "x/a.atlas.tif");
  EXPECT_EQ(parse_addressed("a.ffffffffffffffff.obj")->hash, UINT64_MAX);
  for (const char* name : {"a.obj", "a.fffffffffffffff.obj", "a.FFFFFFFFFFFFFFFF.obj",
                           "a.fffffffffffffff-.obj", "a.0xffffffffffffff.obj", "ffffffffffffffff.obj", ""})
    EXPECT_FALSE(parse_addressed(name)) << name;
  const auto part = [&](std::size_t size) {
    OutputFile(path(std::string(size - 2, 'n') + ".x"), false, OutputFile::Role::kInSet);
  };
  EXPECT_NO_THROW(part(NAME_MAX - 17));
  EXPECT_THROW(part(NAME_MAX - 16), Error);
}

TEST_F(FileSetTest, TidiesWhatKilledWritersLeft) {
  put(".a.rbvh-tmp.head", "half");
  put(".a.part.rbvh-tmp.2.x", "half");
  put(".a.head.lock", "");
  put_addressed("a.part.x", "a part of long ago");
  EXPECT_EQ(write("head", "part"), "");
  EXPECT_EQ(files(), (std::set<std::string>{"a.head", "a.part.x"}));
}

TEST_F(FileSetTest, LeavesOthersFilesAlone) {
  const OutputFile alive(path("a.part.x"), true);  // of a writer that is still at work
  const std::set<std::string> others = {
      fs::path(alive.temporary_path()).filename().string(),
      ".b.rbvh-tmp.head",
      ".a.rbvh-tmp.head~",
      "a.part.0123456789abcdef.x",  // not its hash: not of ours
      "a.part.0123456789ABCDEFG.x",
      put_addressed("b.part.x", "another set's"),
  };
  for (const std::string& name : others)
    if (!exists(folder_ / name)) put(name, "theirs");
  fs::create_directory(path("a.part.fedcba9876543210.x"));
  fs::create_symlink("a.part.0123456789abcdef.x", path(".a.rbvh-tmp.head"));
  EXPECT_EQ(write("head", "part"), "");
  std::set<std::string> expected = others;
  expected.insert({"a.head", "a.part.x", "a.part.fedcba9876543210.x", ".a.rbvh-tmp.head"});
  EXPECT_EQ(files(), expected);
}

TEST_F(FileSetTest, FindsAPartInEitherPlace) {
  const std::string places[] = {path("link.x"), path("a.x")};
  const auto find = [&](const std::string& text) {
    const auto part = find_part(places, text.size(), hash_bytes(text));
    return part ? fs::path(part->path).filename().string() : "";
  };
  EXPECT_EQ(find("new"), "");
  put("a.x", "old");
  EXPECT_EQ(find("new"), "");
  const std::string aside = put_addressed("a.x", "new");
  EXPECT_EQ(find("new"), aside);
  EXPECT_EQ(find("old"), "a.x");
  put("link.x", "new");
  EXPECT_EQ(find("new"), "link.x");
  put(aside, "bad");
  put("link.x", "bad");
  EXPECT_EQ(find("new"), "");
}

TEST_F(FileSetTest, StatesTellFilesApart) {
  put("a", "1");
  const std::string paths[] = {path("a"), path("b")};
  const auto states = file_states(paths);
  EXPECT_EQ(file_states(paths), states);
  put("b", "1");
  EXPECT_NE(file_states(paths), states);
  const auto both = file_states(paths);
  fs::rename(path("b"), path("a"));
  put("b", "1");
  EXPECT_NE(file_states(paths), both);
}

// What holds another writer up.
class Lock {
 public:
  explicit Lock(const std::string& path) : file_{::open(path.c_str(), O_RDWR | O_CREAT, 0666)} {
    EXPECT_EQ(flock(file_.fd, LOCK_EX), 0);
  }

 private:
  Descriptor file_;
};

TEST_F(FileSetTest, WaitsForAnotherWriter) {
  std::thread writer;
  {
    const Lock other(path(".a.head.lock"));
    writer = std::thread([&] { EXPECT_EQ(write("head", "part"), ""); });
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    EXPECT_FALSE(fs::exists(path("a.head")));
  }
  writer.join();
  EXPECT_EQ(files(), (std::set<std::string>{"a.head", "a.part.x"}));
}

TEST_F(FileSetTest, DoesNotWaitForEver) {
  const Lock other(path(".a.head.lock"));
  try {
    write("head", "part");
    ADD_FAILURE() << "another writer holds the lock";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kFailure);
    EXPECT_NE(std::string(error.what()).find("another process"), std::string::npos);
  }
  EXPECT_EQ(files(), std::set<std::string>{".a.head.lock"});
}

TEST_F(FileSetTest, AnInterruptEndsTheWait) {
  const Lock other(path(".a.head.lock"));
  const pid_t child = fork();
  if (child == 0) {
    install_interrupt_cleanup();
    write("head", "part");
    _exit(0);
  }
  while (files().size() < 3)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // its temporary files
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  kill(child, SIGINT);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(WIFEXITED(status) ? WEXITSTATUS(status) : -1, 130);
  EXPECT_EQ(files(), std::set<std::string>{".a.head.lock"});
}

}  // namespace
}  // namespace rbvh
