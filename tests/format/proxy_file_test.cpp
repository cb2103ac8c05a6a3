// The three files of a proxy: written and read back, and refused where they are damaged or mixed up.
#include "io/proxy_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "io/hash.h"
#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"
#include "tests/format/pair_bytes.h"
#include "tests/proxies.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

class ProxyFile : public testing::Test {
 protected:
  ProxyFile() : folder_(fs::temp_directory_path() / ("proxy_file_test." + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~ProxyFile() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  // The message of the error that loading gives, or nothing.
  static std::string fault_of(const std::string& file) {
    try {
      static_cast<void>(load_proxy(file));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kInput) << error.what();
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    return {};
  }
  static std::string text_of(const std::string& file) {
    const Bytes bytes = read_bytes(file);
    return {bytes.begin(), bytes.end()};
  }
  static void write_text(const std::string& file, const std::string& text) {
    write_bytes(file, Bytes(text.begin(), text.end()));
  }
  static std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
  }

  fs::path folder_;
};

TEST_F(ProxyFile, RoundTrip) {
  const Proxy proxy = make_two_patch_proxy();
  ASSERT_EQ(find_fault(proxy), std::nullopt);
  const ProxySource source{"scan.ply", 42, {1e6, -2.5, 0}};
  const ProxyHeader written = save_proxy(path("a.obj"), proxy, source);
  EXPECT_TRUE(is_proxy(path("a.obj")));
  ProxyHeader header;
  const Proxy again = load_proxy(path("a.obj"), &header);
  EXPECT_EQ(again.positions, proxy.positions);
  EXPECT_EQ(again.quads, proxy.quads);
  EXPECT_EQ(again.map, proxy.map);
  ASSERT_EQ(again.tiles.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again.tiles[i].x, proxy.tiles[i].x);
    EXPECT_EQ(again.tiles[i].y, proxy.tiles[i].y);
    EXPECT_EQ(again.tiles[i].side, proxy.tiles[i].side);
    EXPECT_EQ(again.tiles[i].longest_displacement, proxy.tiles[i].longest_displacement);
  }
  EXPECT_EQ(header.major, kProxyMajor);
  EXPECT_EQ(header.bytes(), written.bytes());
  EXPECT_EQ(header.source.name, "scan.ply");
  EXPECT_EQ(header.source.hash, 42u);
  EXPECT_EQ(header.source.shift, source.shift);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 3);  // no temporary file
}

TEST_F(ProxyFile, BytesDependOnTheProxyAlone) {
  save_proxy(path("a.obj"), make_two_patch_proxy());
  set_thread_count(1);
  save_proxy(path("b.obj"), make_two_patch_proxy());
  set_thread_count(0);
  for (const char* end : {".obj", ".vdm.exr", ".vdm.json"})
    EXPECT_EQ(read_bytes(path(std::string("a") + end)), read_bytes(path(std::string("b") + end))) << end;
}

}  // namespace
}  // namespace rbvh
