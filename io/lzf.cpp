#include "io/lzf.h"

#include <cstring>

namespace rbvh {

// A control byte below 32 is followed by that many + 1 literal bytes. Else its upper three bits are a length
// - 2 (7: a further byte is added) and its lower five with the next byte a distance - 1 back into the output.
bool lzf_decompress(std::span<const unsigned char> in, std::span<unsigned char> out) {
  std::size_t from = 0, to = 0;
  while (from < in.size()) {
    const std::size_t control = in[from++];
    if (control < 32) {
      const std::size_t length = control + 1;
      if (length > in.size() - from || length > out.size() - to) return false;
      std::memcpy(out.data() + to, in.data() + from, length);
      from += length;
      to += length;
      continue;
    }
    std::size_t length = control >> 5;
    if (length == 7) {
      if (from == in.size()) return false;
      length += in[from++];
    }
    length += 2;
    if (from == in.size()) return false;
    const std::size_t distance = ((control & 31) << 8) + in[from++] + 1;
    if (distance > to || length > out.size() - to) return false;
    // Byte by byte: a reference may overlap what it writes.
    for (std::size_t i = 0; i < length; ++i, ++to) out[to] = out[to - distance];
  }
  return to == out.size();
}

}  // namespace rbvh
