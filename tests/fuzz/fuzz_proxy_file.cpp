// Arbitrary sidecars over a proxy's own mesh and map, and arbitrary meshes under a true sidecar (the first
// byte says which): what gets through must keep the promises of find_fault().
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "io/hash.h"
#include "io/proxy_file.h"
#include "pipeline/base/error.h"
#include "tests/format/pair_bytes.h"
#include "tests/proxies.h"

namespace {

struct Files {
  std::string sidecar, mesh, map;
};

Files make_files() {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "fuzz_proxy_file";
  std::filesystem::create_directories(folder);
  const std::string path = (folder / (std::to_string(getpid()) + ".obj")).string();
  rbvh::save_proxy(path, rbvh::make_two_patch_proxy(), {}, true);
  const auto text = [](const std::string& file) {
    const rbvh::Bytes bytes = rbvh::read_bytes(file);
    std::filesystem::remove(file);
    return std::string(bytes.begin(), bytes.end());
  };
  return {text(rbvh::proxy_sidecar_path(path)), text(path), text(rbvh::proxy_map_path(path))};
}

// The sidecar names lengths and hashes: those of the mesh at hand are put in.
std::string resealed(const Files& files, const std::string& mesh) {
  std::string text = files.sidecar;
  const auto replace = [&](const std::string& from, const std::string& to) {
    if (const std::size_t at = text.find(from); at != std::string::npos) text.replace(at, from.size(), to);
  };
  const auto hex = [](std::uint64_t hash) {
    char digits[17];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
    return std::string(digits);
  };
  replace("\"bytes\": " + std::to_string(files.mesh.size()), "\"bytes\": " + std::to_string(mesh.size()));
  replace(hex(rbvh::hash_bytes(files.mesh)), hex(rbvh::hash_bytes(mesh)));
  return text;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Files files = make_files();
  if (size == 0) return 0;
  const std::string input(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    const rbvh::Proxy proxy = data[0] % 2 == 0
                                  ? rbvh::decode_proxy(input, files.mesh, files.map, "fuzz.obj")
                                  : rbvh::decode_proxy(resealed(files, input), input, files.map, "fuzz.obj");
    if (rbvh::find_fault(proxy)) std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
  }
  return 0;
}
