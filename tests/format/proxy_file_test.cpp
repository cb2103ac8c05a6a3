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
      EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
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

TEST_F(ProxyFile, MixedUpFilesAreRefused) {
  Proxy other = make_two_patch_proxy();
  for (Vec3f& p : other.positions) p = p * 2.f;
  save_proxy(path("a.obj"), make_two_patch_proxy());
  save_proxy(path("b.obj"), other);
  for (const char* end : {".obj", ".vdm.exr", ".vdm.json"}) {
    const Bytes kept = read_bytes(path(std::string("a") + end)),
                foreign = read_bytes(path(std::string("b") + end));
    if (kept == foreign) continue;  // both have the same map
    write_bytes(path(std::string("a") + end), foreign);
    EXPECT_NE(fault_of(path("a.obj")).find("belongs to another proxy"), std::string::npos) << end;
    write_bytes(path(std::string("a") + end), kept);
  }
  EXPECT_EQ(fault_of(path("a.obj")), "");
  for (const char* end : {".vdm.exr", ".vdm.json"}) {
    const std::string file = path(std::string("a") + end);
    const Bytes kept = read_bytes(file);
    fs::remove(file);
    EXPECT_NE(fault_of(path("a.obj")).find("comes without"), std::string::npos) << end;
    write_bytes(file, kept);
  }
}

TEST_F(ProxyFile, CutOrFlippedAnywhereIsRefused) {
  save_proxy(path("a.obj"), make_two_patch_proxy());
  for (const char* end : {".obj", ".vdm.exr", ".vdm.json"}) {
    const std::string file = path(std::string("a") + end);
    const Bytes kept = read_bytes(file);
    for (std::size_t size = 0; size + 2 < kept.size(); size += 1 + kept.size() / 50) {
      write_bytes(file, Bytes(kept.begin(), kept.begin() + static_cast<std::ptrdiff_t>(size)));
      EXPECT_NE(fault_of(path("a.obj")), "") << end << " cut to " << size;
    }
    write_bytes(file, kept);
  }
  EXPECT_EQ(fault_of(path("a.obj")), "");
}

// What a sidecar may say wrongly although the files are those that it names.
TEST_F(ProxyFile, SidecarsThatLieAreRefused) {
  save_proxy(path("a.obj"), make_two_patch_proxy());
  const std::string sidecar = path("a.vdm.json"), text = text_of(sidecar);
  const std::vector<std::array<std::string, 3>> lies = {
      {"rbvh proxy", "other", "is no sidecar of a proxy"},
      {"\"version\": [\n  1,", "\"version\": [\n  2,", "has version 2.0"},
      {"\"space\": \"object\"", "\"space\": \"tangent\"", "another space, order, scale or midlevel"},
      {"\"midlevel\": 0", "\"midlevel\": 0.5", "another space, order, scale or midlevel"},
      {"\"scale\": 1", "\"scale\": \"1\"", "'scale' is no number"},
      {"\"width\": 8", "\"width\": 16", "texture coordinates"},
      {"\"height\": 5", "\"height\": 0", "no texels"},
      {"\"height\": 5", "\"height\": 65536", "texture coordinates"},
      {"\"height\": 5", "\"height\": -5", "'map.height'"},
      {"[5, 0, 3,", "[6, 0, 3,", "texture coordinates"},
      {"[5, 0, 3,", "[5, 0, 4,", ""},
      {"[5, 0, 3,", "[4, 0, 3,", ""},
      {"[0, 0, 5,", "[0, 0, 4294967297,", "'side'"},
      {"\"tiles\": [", "\"tiles\": [[0, 0, 5, 9],", "tiles"},
      {"\"tiles\"", "\"tyles\"", "'tiles' is missing"}};
  for (const auto& [from, to, part] : lies) {
    write_text(sidecar, replaced(text, from, to));
    const std::string fault = fault_of(path("a.obj"));
    EXPECT_NE(fault, "") << to;
    EXPECT_NE(fault.find(part), std::string::npos) << fault;
  }
  write_text(sidecar, replaced(text, "\"version\": [\n  1,\n  0", "\"version\": [\n  1,\n  7"));
  EXPECT_EQ(fault_of(path("a.obj")), "");  // a newer minor version
  write_text(sidecar, std::string(100000, '['));
  EXPECT_NE(fault_of(path("a.obj")), "");
}

TEST_F(ProxyFile, FaultsAreFound) {
  const auto fault = [](auto&& change) {
    Proxy proxy = make_two_patch_proxy();
    change(proxy);
    return find_fault(proxy).value_or("");
  };
  EXPECT_EQ(fault([](Proxy&) {}), "");
  EXPECT_NE(fault([](Proxy& p) { p.map[4].x += 0.01f; }).find("one surface"), std::string::npos);  // a corner
  EXPECT_NE(fault([](Proxy& p) { p.map[8 + 4].z += 0.01f; }).find("one surface"),
            std::string::npos);  // a chord
  EXPECT_NE(fault([](Proxy& p) { p.map[9].x = NAN; }).find("not finite"), std::string::npos);
  EXPECT_NE(fault([](Proxy& p) { p.positions[0].x = INFINITY; }).find("vertex 0"), std::string::npos);
  EXPECT_NE(fault([](Proxy& p) { p.quads[1][2] = 6; }).find("vertex 6 of 6"), std::string::npos);
  EXPECT_NE(fault([](Proxy& p) { p.tiles[1].side = 4; }).find("2^k + 1"), std::string::npos);
  EXPECT_NE(fault([](Proxy& p) { p.tiles[1].x = 4; }).find("overlaps"), std::string::npos);
  EXPECT_NE(fault([](Proxy& p) { p.tiles[1].y = 3; }).find("reaches out"), std::string::npos);
  EXPECT_NE(fault([](Proxy& p) { p.tiles[0].longest_displacement *= 0.9f; }).find("displaced by"),
            std::string::npos);
  EXPECT_NE(fault([](Proxy& p) { p.quads.clear(); }), "");
  EXPECT_NE(fault([](Proxy& p) { p.tiles.pop_back(); }), "");
  EXPECT_NE(fault([](Proxy& p) { p.map.pop_back(); }), "");
}

TEST_F(ProxyFile, TakesPlacesOfOldFilesOnlyWhenAllowed) {
  save_proxy(path("a.obj"), make_two_patch_proxy());
  EXPECT_THROW(save_proxy(path("a.obj"), make_two_patch_proxy()), Error);
  EXPECT_NO_THROW(save_proxy(path("a.obj"), make_two_patch_proxy(), {}, true));
  Proxy bad = make_two_patch_proxy();
  bad.map[4].x += 1;
  EXPECT_THROW(save_proxy(path("b.obj"), bad), Error);
  EXPECT_FALSE(is_proxy(path("b.obj")));
  write_text(path("c.obj"), "v 0 0 0\n");
  EXPECT_FALSE(is_proxy(path("c.obj")));
  EXPECT_THROW(check_proxy_output(path("c.ply"), true), Error);
}

}  // namespace
}  // namespace rbvh
