#include "io/hash.h"

#include <xxhash.h>

#include <memory>
#include <vector>

#include "io/input_file.h"

namespace rbvh {

std::uint64_t hash_bytes(std::string_view bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

std::uint64_t hash_file(const std::string& path) {
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), XXH3_freeState);
  if (!state) throw std::bad_alloc();
  XXH3_64bits_reset(state.get());
  InputStream in(path);
  std::vector<std::byte> piece(std::size_t{1} << 20);
  for (std::size_t size = piece.size(); size == piece.size();) {
    size = in.read(piece);
    XXH3_64bits_update(state.get(), piece.data(), size);
  }
  return XXH3_64bits_digest(state.get());
}

}  // namespace rbvh
