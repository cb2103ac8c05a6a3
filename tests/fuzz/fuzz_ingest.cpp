// Arbitrary bytes through the whole stage: the reader they choose, cleaning, normals, radii, writing, and
// reading again.
#include <span>

#include "io/ply.h"
#include "io/scan_io.h"
#include "pipeline/scan/ingest.h"
#include "tests/fuzz/scan_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace rbvh;
  try {
    RawScan raw = parse_scan({reinterpret_cast<const char*>(data), size}, "fuzz");
    if (raw.positions.size() > 4096) return 0;
    IngestReport counts;
    const Scan scan = ingest(std::move(raw), "fuzz", {.min_component = 0.01}, counts);
    if (!is_consistent(scan, scan.positions.size())) std::abort();
    for (const Vec3f& p : scan.positions)
      if (!is_finite(p)) std::abort();
    std::string bytes;
    encode_ply(scan, [&](std::span<const std::byte> piece) {
      bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    });
    const RawScan again = read_ply(bytes, "again");
    if (again.positions.size() != scan.positions.size() || again.triangles != scan.triangles) std::abort();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput) std::abort();
  }
  return 0;
}
