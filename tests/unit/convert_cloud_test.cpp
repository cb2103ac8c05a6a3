// Clouds through rbvh-convert: programs of that name that do right and wrong, on a PATH of their own.
#include "io/convert_cloud.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/scan_io.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

/// LAS 1.2, one point at (1, 2, 3); compressed ones differ by a bit.
std::string las(bool compressed) {
  std::string bytes(227 + 20, '\0');
  const auto put = [&](std::size_t at, const auto& value) { std::memcpy(&bytes[at], &value, sizeof value); };
  bytes.replace(0, 4, "LASF");
  bytes[24] = 1;
  bytes[25] = 2;
  bytes[104] = compressed ? '\x80' : '\0';
  put(94, std::uint16_t{227});
  put(96, std::uint32_t{227});
  put(105, std::uint16_t{20});
  put(107, std::uint32_t{1});
  for (std::size_t axis = 0; axis < 3; ++axis) {
    put(131 + 8 * axis, 0.5);
    put(227 + 4 * axis, static_cast<std::int32_t>(2 * (axis + 1)));
  }
  return bytes;
}

class ConvertCloud : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "rbvh_test_XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    old_path_ = std::getenv("PATH");
    setenv("PATH", (folder_ + ":" + old_path_).c_str(), 1);
  }
  void TearDown() override {
    setenv("PATH", old_path_.c_str(), 1);
    std::filesystem::remove_all(folder_);
  }
  void converter(const std::string& script) const {
    const std::string program = folder_ + "/rbvh-convert";
    std::ofstream(program) << "#!/bin/sh\n" << script << "\n";
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  }
  static std::string fault(const std::string& bytes, const std::string& kind = "laz") {
    try {
      convert_cloud(bytes, kind, "a.laz");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    return "none";
  }

  std::string folder_, old_path_;
};

TEST_F(ConvertCloud, WhatItWritesIsRead) {
  std::ofstream(folder_ + "/plain.las", std::ios::binary) << las(false);
  converter("[ $1 = laz ] && cat > " + folder_ + "/in && cat " + folder_ + "/plain.las");
  for (const char* name : {"a.laz", "a.las", "a"}) {
    const RawScan scan = parse_scan(las(true), name);
    ASSERT_EQ(scan.positions.size(), 1u);
    EXPECT_EQ(scan.positions[0], (Vec3d{1, 2, 3}));
  }
  std::ifstream in(folder_ + "/in", std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), las(true));
  converter("[ $1 = e57 ] && cat > /dev/null && echo '1.5 2.5 3.5 9 8 7'");
  const RawScan scan = parse_scan("ASTM-E57 and more", "a.e57");
  ASSERT_EQ(scan.positions.size(), 1u);
  EXPECT_EQ(scan.colors[0], (Color8{9, 8, 7}));
  EXPECT_EQ(scan.notes.size(), 1u);
}

TEST_F(ConvertCloud, LargeInputAndOutputPassAtOnce) {
  converter("exec cat");  // writes while it reads
  const std::string bytes(20'000'000, 'x');
  EXPECT_EQ(convert_cloud(bytes, "laz", "a.laz"), bytes);
  converter("echo early; exit 0");  // reads nothing
  EXPECT_EQ(convert_cloud(bytes, "laz", "a.laz"), "early\n");
}

TEST_F(ConvertCloud, FailuresAreOneLine) {
  converter("cat > /dev/null; echo 'chunk 3 is damaged' >&2; echo more >&2; exit 1");
  EXPECT_EQ(fault("abc"), "a.laz: rbvh-convert fails: chunk 3 is damaged");
  converter("kill -9 $$");
  EXPECT_EQ(fault("abc"), "a.laz: rbvh-convert fails: it says nothing");
  converter("exec yes");  // no end
  EXPECT_NE(fault("abc").find("times its size"), std::string::npos);
  converter("cat");  // compressed still
  EXPECT_THROW(parse_scan(las(true), "a.laz"), Error);
  setenv("PATH", "/nowhere", 1);
  EXPECT_NE(fault("abc").find("rbvh-convert reads"), std::string::npos);
  EXPECT_NE(fault("abc", "e57").find("convert it to PLY"), std::string::npos);
}

}  // namespace
}  // namespace rbvh
