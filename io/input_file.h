// A whole input in memory. Readers parse from here, so that every count can be checked against the bytes that
// are there.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace rbvh {

/// The bytes of a file, read once. Not mapped: a mapped file that another program truncates raises SIGBUS.
struct InputBytes {
  std::unique_ptr<char[]> data;
  std::size_t size = 0;
  std::string_view view() const { return {data.get(), size}; }
};

/// Reads `path` ("-": standard input) to its end. Throws Error(kInput) when it is missing, a folder, or
/// unreadable, Error(kBudget) when memory does not hold it.
InputBytes read_input(const std::string& path);

/// How an input is named in messages: its path, or "standard input".
std::string input_name(const std::string& path);

}  // namespace rbvh
