// .npy tables: what NumPy writes is read, what we write is what it would write, and nothing else gets in.
#include "io/npy.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/input_file.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {
namespace fs = std::filesystem;

constexpr std::size_t kRays[] = {6, 8};

std::string make_npy(const std::string& dict, std::size_t floats, int major = 1) {
  std::string header = dict;
  while ((header.size() + 11) % 64 != 0) header += ' ';
  header += '\n';
  std::string bytes = "\x93NUMPY";
  bytes += static_cast<char>(major);
  bytes += '\0';
  bytes += static_cast<char>(header.size() & 255);
  bytes += static_cast<char>(header.size() >> 8);
  if (major > 1) bytes.append(2, '\0');
  bytes += header;
  for (std::size_t i = 0; i < floats; ++i) {
    const float value = static_cast<float>(i) * 0.5f;
    bytes.append(reinterpret_cast<const char*>(&value), 4);
  }
  return bytes;
}

std::string dict(const std::string& shape, const std::string& descr = "<f4",
                 const std::string& fortran = "False") {
  return "{'descr': '" + descr + "', 'fortran_order': " + fortran + ", 'shape': " + shape + ", }";
}

std::string refusal(const std::string& bytes) {
  try {
    decode_npy(bytes, "r.npy", kRays);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    const std::string what = error.what();
    EXPECT_EQ(what.find('\n'), std::string::npos);
    EXPECT_EQ(what.find("r.npy: "), 0u);
    return what;
  }
  return {};
}

void expect_refused(const std::string& bytes, const std::string& part) {
  EXPECT_NE(refusal(bytes).find(part), std::string::npos)
      << '"' << refusal(bytes) << "\" lacks \"" << part << '"';
}

TEST(Npy, ReadsEveryVersion) {
  for (const int major : {1, 2, 3})
    for (const std::size_t columns : kRays) {
      const FloatTable table =
          decode_npy(make_npy(dict("(3, " + std::to_string(columns) + ")"), 3 * columns, major), "", kRays);
      EXPECT_EQ(table.rows, 3u);
      EXPECT_EQ(table.columns, columns);
      ASSERT_EQ(table.values.size(), 3 * columns);
      EXPECT_EQ(table.values.back(), 0.5f * static_cast<float>(3 * columns - 1));
    }
}

TEST(Npy, ReadsOtherSpellings) {
  EXPECT_EQ(decode_npy(make_npy(R"({"shape":(1,6),"fortran_order":False,"descr":"<f4"})", 6), "", kRays).rows,
            1u);
  EXPECT_EQ(decode_npy(make_npy(dict("( 1 , 6 , )"), 6), "", kRays).rows, 1u);
  EXPECT_EQ(decode_npy(make_npy(dict("(0, 8)"), 0), "", kRays).rows, 0u);
}

TEST(Npy, DoublesAreNarrowedLessTheShift) {
  std::string bytes = make_npy(dict("(2, 6)", "<f8"), 0);
  for (int i = 0; i < 12; ++i) {
    const double value = 5432871.0001 + i;
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  const FloatTable table = decode_npy(bytes, "", kRays, {5432871, 5432871, 5432870});
  EXPECT_NEAR(table.values[0], 0.0001f, 1e-6f);
  EXPECT_NEAR(table.values[8], 9.0001f, 1e-5f);
  EXPECT_EQ(table.values[3], 5432874.0f);
  bytes.pop_back();
  expect_refused(bytes, "");
}

TEST(Npy, RefusesOtherArrays) {
  EXPECT_EQ(decode_npy(make_npy(dict("(1, 6)", "<f8"), 12), "", kRays).rows, 1u);
  expect_refused(make_npy(dict("(1, 6)", "<i4"), 6), "astype('<f4')");
  expect_refused(make_npy(dict("(1, 6)", ">f4"), 6), "'>f4'");
  expect_refused(make_npy(dict("(1, 6)", "<f4", "True"), 6), "ascontiguousarray");
  expect_refused(make_npy(dict("(2, 5)"), 10), "(2, 5); (N, 6) or (N, 8)");
  expect_refused(make_npy(dict("(6,)"), 6), "(6,)");
  expect_refused(make_npy(dict("()"), 1), "shape ()");
  expect_refused(make_npy(dict("(1, 1, 6)"), 6), "(1, 1, 6)");
  expect_refused(make_npy("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (1, 6), }", 6),
                 "plain array");
}

TEST(Npy, RefusesDamage) {
  expect_refused("", "no .npy");
  expect_refused("PK\x03\x04", "no .npy");
  expect_refused(make_npy(dict("(3, 6)"), 17), "2 whole ones are there");
  expect_refused(make_npy(dict("(3, 6)"), 19), "4 bytes too many");
  expect_refused(make_npy(dict("(3, 6)"), 18, 4), "version 4.0");
  expect_refused(make_npy(dict("(4611686018427387905, 8)"), 8), "is cut");
  expect_refused(make_npy(dict("(18446744073709551616, 8)"), 8), "plain array");
  expect_refused(make_npy(dict("(-1, 8)"), 8), "plain array");
  expect_refused(make_npy(dict("(1, 6)") + "x", 6), "plain array");
  expect_refused(make_npy("{'descr': '<f4', 'shape': (1, 6), }", 6), "plain array");
  expect_refused(make_npy("{'descr': '<f4", 6), "plain array");
  std::string endless = make_npy(dict("(1, 6)"), 6, 2);
  endless.replace(8, 4, "\xff\xff\xff\xff");
  expect_refused(endless, "within its header");
}

TEST(Npy, EveryTruncationIsRefused) {
  const std::string whole = make_npy(dict("(3, 6)"), 18);
  for (std::size_t size = 0; size < whole.size(); ++size)
    ASSERT_NE(refusal(whole.substr(0, size)), "") << size;
  EXPECT_EQ(refusal(whole), "");
}

TEST(Npy, WritesWhatItReads) {
  std::string pattern = (fs::temp_directory_path() / "rbvh_npy_XXXXXX").string();
  const fs::path folder = mkdtemp(pattern.data());
  const std::string path = (folder / "h.npy").string();
  const std::vector<float> values = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  write_npy(path, values, 8, false);
  const FloatTable table = read_npy(path, kRays);
  EXPECT_EQ(table.rows, 2u);
  EXPECT_EQ(table.values, values);
  // numpy.save's header, to the byte.
  const std::string bytes(read_input(path).view());
  EXPECT_EQ(
      bytes.substr(0, 128),
      std::string("\x93NUMPY\x01\0\x76\0{'descr': '<f4', 'fortran_order': False, 'shape': (2, 8), }", 69) +
          std::string(58, ' ') + "\n");
  EXPECT_EQ(bytes.size(), 128 + sizeof(float) * 16);
  write_npy(path, {}, 8, true);
  EXPECT_EQ(read_npy(path, kRays).rows, 0u);
  EXPECT_THROW(write_npy(path, values, 8, false), Error);
  fs::remove_all(folder);
}

TEST(Npy, PiecesAreTheWholeFile) {
  const std::string path = testing::TempDir() + "pieces_" + std::to_string(::getpid()) + ".npy";
  std::vector<float> values(8 * 1001);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
  write_npy(path, values, 8, true);
  for (const std::size_t rows : {1u, 7u, 1001u, 2000u}) {
    NpyReader reader(path, kRays);
    EXPECT_EQ(reader.rows(), 1001u);
    EXPECT_EQ(reader.columns(), 8u);
    std::vector<float> piece(rows * 8 + 3), all;
    while (const std::size_t got = reader.read(piece))
      all.insert(all.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(got * 8));
    EXPECT_EQ(all, values) << rows;
  }
  // A file's length is checked before anything is read.
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 1);
  EXPECT_THROW(NpyReader bad(path, kRays), Error);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) + 2);
  EXPECT_THROW(NpyReader bad(path, kRays), Error);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace rbvh
