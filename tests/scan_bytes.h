// What tests of readers share: bytes made by hand, and reading them as a file of some name.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/ply.h"
#include "io/scan_io.h"
#include "pipeline/base/error.h"

namespace rbvh {

/// The bytes of a value as this (little-endian) host has them.
template <class T>
std::string raw(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}
template <class T>
std::string raw_big_endian(T value) {
  std::string bytes = raw(value);
  std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

inline std::string encoded(const Scan& scan) {
  std::string bytes;
  encode_ply(scan, [&](std::span<const std::byte> piece) {
    bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
  });
  return bytes;
}

/// The message of the kInput error that reading `bytes` gives; anything else fails the test.
inline std::string input_error(std::string_view bytes, const std::string& name) {
  try {
    parse_scan(bytes, name);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error for " << name;
  return "";
}

/// Reads every prefix of `bytes`: each is a scan or a kInput error, and all shorter than `least` are errors.
inline void check_prefixes(std::string_view bytes, const std::string& name, std::size_t least) {
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    // A copy of its own, so that a sanitizer sees the first byte read behind the end.
    const std::vector<char> prefix(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    try {
      parse_scan({prefix.data(), prefix.size()}, name);
      EXPECT_GE(size, least) << name << " cut to " << size << " bytes was read";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
    }
  }
}

}  // namespace rbvh
