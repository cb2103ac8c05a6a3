#include "io/hash.h"

#include <spdlog/fmt/fmt.h>
#include <xxhash.h>

#include <new>
#include <vector>

#include "io/input_file.h"

namespace rbvh {

Hasher::Hasher()
    : state_(XXH3_createState(), [](void* state) { XXH3_freeState(static_cast<XXH3_state_t*>(state)); }) {
  if (state_ == nullptr) throw std::bad_alloc();
  XXH3_64bits_reset(static_cast<XXH3_state_t*>(state_.get()));
}

void Hasher::add(std::span<const std::byte> bytes) {
  XXH3_64bits_update(static_cast<XXH3_state_t*>(state_.get()), bytes.data(), bytes.size());
}

std::uint64_t Hasher::value() const { return XXH3_64bits_digest(static_cast<XXH3_state_t*>(state_.get())); }

std::uint64_t hash_bytes(std::string_view bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

std::uint64_t hash_file(const std::string& path) {
  Hasher hasher;
  InputStream in(path);
  std::vector<std::byte> piece(std::size_t{1} << 20);
  for (std::size_t size = piece.size(); size == piece.size();) {
    size = in.read(piece);
    hasher.add(std::span(piece).first(size));
  }
  return hasher.value();
}

std::string hash_digits(std::uint64_t hash) { return fmt::format("{:016x}", hash); }

}  // namespace rbvh
