// Arbitrary bytes as the chain of a batch.
#include <cstdlib>

#include "batch/chain.h"
#include "pipeline/base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const rbvh::Chain chain = rbvh::decode_chain({reinterpret_cast<const char*>(data), size}, "fuzz.json");
    if (chain.steps.empty()) std::abort();
    for (const rbvh::ChainStep& step : chain.steps)
      if (step.name.find('/') != std::string::npos ||
          rbvh::fill_fields(step.output, {{"name", "scan"}}).find("..") == 0)
        std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
    if (std::string_view(error.what()).find('\n') != std::string_view::npos) std::abort();
  }
  return 0;
}
