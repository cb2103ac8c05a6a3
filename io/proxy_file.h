// A proxy on disk (docs/proxy.md): N.obj (quads, texture coordinates at texel centres), N.vdm.exr (the
// displacement) and N.vdm.json, the sidecar that ties them together. An OBJ with that sidecar is a proxy.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "pipeline/proxy/proxy.h"

namespace rbvh {

/// Version of the format that save_proxy() writes. load_proxy() reads every minor version of this major one.
inline constexpr std::uint16_t kProxyMajor = 1, kProxyMinor = 0;

/// What a proxy was made of.
struct ProxySource {
  std::string name;        ///< of the file, without folders
  std::uint64_t hash = 0;  ///< of its bytes
  Vec3d shift{};           ///< original coordinates are the proxy's + shift
};

/// What the files hold beside the proxy.
struct ProxyHeader {
  std::uint16_t major = 0, minor = 0;
  std::uint64_t mesh_bytes = 0, map_bytes = 0, sidecar_bytes = 0;
  std::uint64_t mesh_hash = 0, map_hash = 0;
  std::string map_file;  ///< where it was found: proxy_map_path(), or what addressed_path() makes of that
  ProxySource source;
  std::uint64_t bytes() const { return mesh_bytes + map_bytes + sidecar_bytes; }
};

/// The other two files, beside the OBJ by its stem. While a writer replaces the proxy, and where it was not
/// able to replace OBJ or map, the new ones lie beside these names (io/file_set.h).
std::string proxy_map_path(const std::string& path);
std::string proxy_sidecar_path(const std::string& path);

/// True for an .obj with a sidecar beside it, or beside what it leads to as a link.
bool is_proxy(const std::string& path);

/// For readers of scans, which would take the base mesh for the scan. Throws Error(kInput) where is_proxy(),
/// or would be but for a sidecar that is missing.
void refuse_proxy(const std::string& path);

/// Reads and checks all three: version, lengths, hashes, and everything that find_fault() does. Where a
/// writer replaces the proxy meanwhile, the result is the old one or the new one. Hostile input is expected.
/// Throws Error(kInput) naming the first fault in a sentence.
Proxy load_proxy(const std::string& path, ProxyHeader* header = nullptr);

/// The same of bytes in memory; `path` is for messages.
Proxy decode_proxy(std::string_view sidecar, std::string_view mesh, std::string_view map,
                   const std::string& path, ProxyHeader* header = nullptr);

/// Writes all three; at every moment, a reader finds the old proxy or the new one, whole (io/file_set.h).
/// Where `path` is a link, they go beside what it leads to. Identical proxies give identical bytes. The proxy
/// must have no find_fault(). Throws Error(kFailure): the old proxy is as it was.
ProxyHeader save_proxy(const std::string& path, const Proxy& proxy, const ProxySource& source = {},
                       bool overwrite = false);

/// Throws the same Error as save_proxy() would for an output that cannot be, before any work is done.
void check_proxy_output(const std::string& path, bool overwrite);

}  // namespace rbvh
