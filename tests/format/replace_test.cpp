// A pair or a proxy that is replaced is the old one or the new one at every moment, whole, whatever happens
// to its writer; and the next writer leaves nothing of an unlucky one behind.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <map>
#include <thread>

#include "io/proxy_file.h"
#include "io/rbvh_file.h"
#include "pipeline/base/error.h"
#include "tests/faults/faults.h"
#include "tests/format/pair_bytes.h"
#include "tests/output_warning.h"
#include "tests/proxies.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;
using Contents = std::map<std::string, Bytes>;  // by file name

// How a writer ends.
constexpr int kDone = 0, kFailed = 1, kOtherError = 8, kDoneWithWarning = 10, kKilled = 128 + SIGKILL;

// Files that belong together, in versions 0, 1, ...
struct FileSet {
  std::string name;  // by which users name it
  std::string head;  // names the others
  std::function<std::string(const std::string& path, int version, bool overwrite)> write;  // to the warning
  std::function<int(const std::string& path)> read;                                        // to the version
};

void PrintTo(const FileSet& set, std::ostream* out) { *out << set.name; }

Proxy make_proxy(int version) {
  Proxy proxy = make_two_patch_proxy();
  const float scale = std::ldexp(1.f, version);
  for (Vec3f& p : proxy.positions) p = p * scale;
  for (Vec3f& d : proxy.map) d = d * scale;
  measure_displacements(proxy);
  return proxy;
}

// With two images in its atlas, as few calls as there may be.
Rbvh make_pair(int version) {
  Rbvh rbvh = make_small_rbvh(static_cast<std::uint32_t>(version));
  rbvh.levels.resize(1);
  rbvh.levels[0].layers.resize(2);
  return rbvh;
}

int read_pair_version(const std::string& path) {
  const Rbvh read = read_rbvh(path);
  for (const int version : {0, 1})
    if (const Rbvh expected = make_pair(version); read.source.hash == expected.source.hash) {
      EXPECT_EQ(read.levels[0].layers[0].texels, expected.levels[0].layers[0].texels);
      return version;
    }
  ADD_FAILURE() << "another pair";
  return -1;
}

int read_proxy_version(const std::string& path) {
  if (!is_proxy(path)) throw Error(ErrorKind::kInput, path, "is no proxy");
  const Proxy read = load_proxy(path);
  for (const int version : {0, 1})
    if (const Proxy expected = make_proxy(version); read.positions == expected.positions) {
      EXPECT_EQ(read.map, expected.map);
      return version;
    }
  ADD_FAILURE() << "another proxy";
  return -1;
}

const FileSet kPair = {"a.rbvh", "a.rbvh",
                       [](const std::string& path, int version, bool overwrite) {
                         return output_warning([&] { write_rbvh(path, make_pair(version), overwrite); });
                       },
                       read_pair_version};
const FileSet kProxy = {
    "a.obj", "a.vdm.json",
    [](const std::string& path, int version, bool overwrite) {
      return output_warning([&] { save_proxy(path, make_proxy(version), {}, overwrite); });
    },
    read_proxy_version};

// All calls that others see something of.
const char* const kNotWrite = "open,fsync,flock,rename,unlink";

class Replace : public testing::TestWithParam<FileSet> {
 protected:
  Replace() {
    OIIO::attribute("exr_threads", -1);  // none: a fork would have lost them
    std::string pattern = (fs::temp_directory_path() / "rbvh_replace_XXXXXX").string();
    folder_ = fs::canonical(mkdtemp(pattern.data()));
    fs::create_directory(folder_ / "out");
    for (const int version : {0, 1}) {
      put({});
      write(version);
      versions_[version] = outputs();
    }
  }
  ~Replace() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / "out" / name).string(); }
  Contents outputs() const {
    Contents contents;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "out"))
      contents[entry.path().filename().string()] = read_bytes(entry.path().string());
    return contents;
  }
  /// out/ has these files and no others.
  void put(const Contents& contents) const {
    fs::remove_all(folder_ / "out");
    fs::create_directory(folder_ / "out");
    for (const auto& [name, bytes] : contents) write_bytes(path(name), bytes);
  }
  std::string write(int version) const { return GetParam().write(path(GetParam().name), version, true); }
  int read() const { return GetParam().read(path(GetParam().name)); }
  /// Which one lies there whole; -1: none.
  int version() const {
    if (!fs::exists(path(GetParam().head))) return -1;
    int version = -1;
    EXPECT_NO_THROW(version = read());
    return version;
  }

  Fault fault(int at, const std::string& what, const std::string& calls = {}) const {
    const std::string log = (folder_ / "log").string();
    fs::remove(log);
    return {(folder_ / "out").string(), at, what, calls, log};
  }
  /// How a writer of `version` ends that no fault kills.
  int try_to_write(int version, bool overwrite) const {
    try {
      const std::string warning = GetParam().write(path(GetParam().name), version, overwrite);
      return warning.empty()                           ? kDone
             : warning.find('\n') == std::string::npos ? kDoneWithWarning
                                                       : kOtherError;
    } catch (const Error& error) {
      const bool is_one_line = std::string(error.what()).find('\n') == std::string::npos;
      return error.kind() == ErrorKind::kFailure && is_one_line ? kFailed : kOtherError;
    }
  }
  pid_t start_writer(const Fault& fault, int version, bool overwrite = true) const {
    return start_child(fault, [=, this] { return try_to_write(version, overwrite); });
  }
  int run_writer(const Fault& fault, int version, bool overwrite = true) const {
    if (fault.what == "kill") return end_of(start_writer(fault, version, overwrite));
    return run_here(fault, [=, this] { return try_to_write(version, overwrite); });
  }

  /// Where files are as in `start`, writes version 1 with a fault at each call in turn.
  void expect_recovery(const Contents& start, const std::string& what, const std::string& calls = {}) const {
    put(start);
    const int old_version = version();
    int old_seen = 0, new_seen = 0;
    for (int at = 1;; ++at) {
      SCOPED_TRACE(what + " at call " + std::to_string(at));
      put(start);
      const Fault fault = this->fault(at, what, calls);
      const int code = run_writer(fault, 1);
      const int now = version();
      ASSERT_TRUE(now == old_version || now == 1) << now;
      if (what == "kill" && happened(fault))
        EXPECT_EQ(code, kKilled);
      else if (old_version != 1)
        EXPECT_TRUE(now == 1 ? code == kDone || code == kDoneWithWarning : code == kFailed) << code;
      else
        EXPECT_TRUE(code == kDone || code == kDoneWithWarning || code == kFailed) << code;
      if (code == kFailed && !what.ends_with('+')) {
        EXPECT_EQ(outputs(), start);
      }
      write(0);
      EXPECT_EQ(outputs(), versions_[0]);  // nothing is left over
      if (!happened(fault)) break;
      ++(now == 1 ? new_seen : old_seen);
    }
    EXPECT_GE(old_seen, old_version == 1 ? 0 : 10);
    EXPECT_GE(new_seen, 4);
  }
  /// Version 1 where its parts cannot come to their places, and those of version 0 stay.
  Contents misplaced() const {
    put(versions_[0]);
    const int parts = static_cast<int>(versions_[0].size()) - 1;
    EXPECT_EQ(run_writer(fault(parts + 2, std::to_string(EPERM) + "+", "rename"), 1), kDoneWithWarning);
    EXPECT_EQ(outputs().size(), versions_[0].size() + static_cast<std::size_t>(parts));
    EXPECT_EQ(version(), 1);
    return outputs();
  }

  fs::path folder_;
  Contents versions_[2];
};

TEST_P(Replace, AKilledWriter) { expect_recovery(versions_[0], "kill"); }
TEST_P(Replace, AKilledFirstWriter) { expect_recovery({}, "kill", kNotWrite); }
TEST_P(Replace, AnErrorAtAnyCall) { expect_recovery(versions_[0], std::to_string(EIO)); }
TEST_P(Replace, ADiskThatDiesAtAnyCall) { expect_recovery(versions_[0], std::to_string(EIO) + "+"); }

// The same bytes again, whose parts lie where they should not.
TEST_P(Replace, WhatCouldNotComeToItsPlace) {
  const Contents start = misplaced();
  expect_recovery(start, "kill", kNotWrite);
  expect_recovery(start, std::to_string(EIO));
  put(start);
  write(0);
  EXPECT_EQ(outputs(), versions_[0]);
}

// What a cut of the power needs.
TEST_P(Replace, EachStepIsOnDiskBeforeTheNext) {
  put(versions_[0]);
  const Fault none = fault(0, "", "fsync,rename");
  EXPECT_EQ(run_writer(none, 1), kDone);
  std::ifstream in(none.log);
  std::string call, file, calls;
  while (in >> call && std::getline(in, file))
    if (call != "from")
      calls += call == "fsync" && file != " " ? "file " : call == "fsync" ? "folder " : file.substr(2) + " ";
  std::string head = GetParam().head, aside, places, files = "file ";
  for (const auto& [name, bytes] : versions_[1]) {
    if (name == head) continue;
    files += "file ";
    places += name + " ";
  }
  const std::size_t begin = calls.find(head + " ");
  ASSERT_NE(begin, std::string::npos) << calls;
  EXPECT_EQ(calls.substr(0, files.size()), files) << calls;
  EXPECT_EQ(calls.substr(begin - 7), "folder " + head + " folder " + places + "folder ") << calls;
}

// Whatever the first is about to do when the second begins.
TEST_P(Replace, TwoWritersAtOnce) {
  for (int at = 1;; ++at) {
    SCOPED_TRACE("call " + std::to_string(at));
    put(at % 2 == 0 ? versions_[0] : Contents{});
    const Fault pause = fault(at, "pause", "rename,flock,unlink");
    const pid_t first = start_writer(pause, 0);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    EXPECT_EQ(run_writer({path("nowhere")}, 1), kDone);
    EXPECT_EQ(end_of(first), kDone);
    EXPECT_EQ(outputs(), versions_[version() == 0 ? 0 : 1]);
    if (!happened(pause)) break;
  }
}

TEST_P(Replace, TwoFirstWritersOfWhichOneMayWrite) {
  for (int at = 1; at < 9; ++at) {
    put({});
    const pid_t first = start_writer(fault(at, "pause", "rename,flock"), 0, false);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const int second = run_writer({path("nowhere")}, 1, false);
    const int codes[] = {end_of(first), second};
    const int winner = version();
    ASSERT_GE(winner, 0);
    EXPECT_EQ(codes[winner], kDone);
    EXPECT_EQ(codes[1 - winner], kFailed);
    EXPECT_EQ(outputs(), versions_[winner]);
  }
}

// All of a replacement, or two, between two steps of a reader.
TEST_P(Replace, AReaderWhileAWriterReplaces) {
  for (const int replacements : {1, 2})
    for (int at = 1;; ++at) {
      SCOPED_TRACE("call " + std::to_string(at));
      put(versions_[0]);
      const Fault pause = fault(at, "pause", "open");
      const pid_t reader = start_child(pause, [&] {
        try {
          read();
          return kDone;
        } catch (const Error&) {
          return kFailed;
        }
      });
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      for (int i = 0; i < replacements; ++i) write(1 - i);
      EXPECT_EQ(end_of(reader), kDone);
      if (!happened(pause)) break;
    }
}

TEST_P(Replace, AReaderNeverFails) {
  using Clock = std::chrono::steady_clock;
  put(versions_[0]);
  const pid_t writer = start_child({path("nowhere")}, [&] {
    const auto end = Clock::now() + std::chrono::milliseconds(600);
    for (int i = 0; Clock::now() < end; ++i) write(i % 2);
    return kDone;
  });
  int seen[2] = {};
  while (waitpid(writer, nullptr, WNOHANG) == 0) ASSERT_NO_THROW(++seen[read()]);
  EXPECT_GT(seen[0], 0);
  EXPECT_GT(seen[1], 0);
}

TEST_P(Replace, ThroughALink) {
  const std::string name = GetParam().name;
  const std::string real = "x" + fs::path(name).extension().string();
  put({});
  fs::create_directory(path("real"));
  GetParam().write(path("real/" + real), 0, true);
  fs::create_symlink("real/" + real, path(name));
  EXPECT_EQ(read(), 0);  // although nothing lies beside the link
  EXPECT_EQ(write(1), "");
  EXPECT_EQ(read(), 1);
  EXPECT_TRUE(fs::is_symlink(path(name)));
  EXPECT_EQ(GetParam().read(path("real/" + real)), 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(path("")), {}), 2);  // the link, the folder
  std::size_t same = 0;
  for (const auto& [file, bytes] : versions_[1]) same += read_bytes(path("real/x" + file.substr(1))) == bytes;
  EXPECT_EQ(same, versions_[1].size());
  EXPECT_EQ(std::distance(fs::directory_iterator(path("real")), {}), static_cast<std::ptrdiff_t>(same));
  // Its parts where they could not come to their places.
  const int last = static_cast<int>(same) + 1;
  EXPECT_EQ(run_writer(fault(last, std::to_string(EPERM) + "+", "rename"), 0), kDoneWithWarning);
  EXPECT_EQ(read(), 0);
}

// A link of another file's name is replaced itself: where the set lies is for the name to say that users
// give.
TEST_P(Replace, ALinkOfAnotherFilesName) {
  for (const auto& [name, bytes] : versions_[0]) {
    if (name == GetParam().name) continue;
    put(versions_[0]);
    fs::create_directory(folder_ / "elsewhere");
    fs::rename(path(name), folder_ / "elsewhere" / name);
    fs::create_symlink(folder_ / "elsewhere" / name, path(name));
    EXPECT_EQ(read(), 0);
    EXPECT_EQ(write(1), "");
    EXPECT_FALSE(fs::is_symlink(path(name)));
    EXPECT_EQ(read_bytes((folder_ / "elsewhere" / name).string()), bytes);
    EXPECT_EQ(outputs(), versions_[1]);
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, Replace, testing::Values(kPair, kProxy),
                         [](const auto& info) { return info.param.name == kPair.name ? "Pair" : "Proxy"; });

// --- what users are told

class ReplacePair : public Replace {};

TEST_P(ReplacePair, SaysWhatWentWrongAfterAll) {
  put(versions_[0]);
  const auto warning = [&](const Fault& fault) {
    std::string line;
    run_here(fault, [&] {
      line = write(1);
      return 0;
    });
    return line;
  };
  const std::string in_the_way = warning(fault(3, std::to_string(EPERM), "rename"));
  PairHeader header;
  read_rbvh(path("a.rbvh"), &header);
  EXPECT_NE(header.atlas_file, path("a.atlas.tif"));
  EXPECT_EQ(in_the_way, path("a.atlas.tif") +
                            " cannot be replaced (Operation not permitted); the new one is " +
                            header.atlas_file + " and is read instead");
  put(versions_[0]);
  EXPECT_NE(warning(fault(4, std::to_string(EIO), "fsync")).find("a.atlas.tif lies in"), std::string::npos);
  put(versions_[0]);
  EXPECT_EQ(warning(fault(5, std::to_string(EIO), "fsync")),
            path("a.rbvh") + " is written, but its folder cannot be synced to disk: Input/output error");
  EXPECT_EQ(outputs(), versions_[1]);
}
INSTANTIATE_TEST_SUITE_P(Pair, ReplacePair, testing::Values(kPair));

}  // namespace
}  // namespace rbvh
