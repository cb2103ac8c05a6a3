// Arbitrary bytes as a table of parts: as they are, and behind a first line that carries their hash.
#include <cstdlib>

#include "io/hash.h"
#include "io/parts_file.h"
#include "pipeline/base/error.h"

namespace {

void decode(const std::string& text) {
  try {
    const rbvh::PartsTable table = rbvh::decode_parts(text, "fuzz.rbvh");
    if (table.parts.empty() || table.levels.empty()) std::abort();
    for (const rbvh::PairPart& part : table.parts)
      if (part.levels.size() != table.levels.size() || part.file.find("..") == 0 || part.file[0] == '/')
        std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
    if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  decode(bytes);
  const std::string body = bytes.substr(bytes.find('\n') + 1);  // without the old hash
  decode(std::string(rbvh::kPartsMagic) + "1 " + rbvh::hash_digits(rbvh::hash_bytes(body)) + "\n" + body);
  return 0;
}
