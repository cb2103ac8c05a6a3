// The hash of file contents, as pairs record their source's and their own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace rbvh {

/// XXH3, 64 bits, of bytes that come piece by piece.
class Hasher {
 public:
  Hasher();
  void add(std::span<const std::byte> bytes);
  std::uint64_t value() const;

 private:
  std::unique_ptr<void, void (*)(void*)> state_;
};

/// The same of bytes that are there.
std::uint64_t hash_bytes(std::string_view bytes);

/// The same of a file's bytes, in little memory. Throws Error(kInput) where it cannot be read.
std::uint64_t hash_file(const std::string& path);

/// As files record it: 16 hexadecimal digits.
std::string hash_digits(std::uint64_t hash);

}  // namespace rbvh
