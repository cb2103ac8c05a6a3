#include "cli/remedies.h"

namespace rbvh {
namespace {

const char* words(Remedy remedy) {
  switch (remedy) {
    case Remedy::kNone:
      break;
    case Remedy::kOverwrite:
      return "; use --force to replace it";
    case Remedy::kMemoryBudget:
      return "; raise --memory or ask for less";
    case Remedy::kViewUp:
      return "; give another --camera-view-up";
    case Remedy::kPatchCount:
      return "; allow more, or leave small parts out (--patches, --min-component)";
    case Remedy::kDisplacementScale:
      return "; are --vdm-scale and --vdm-midlevel right?";
    case Remedy::kDisplacementZero:
      return "; say which value means none (--vdm-midlevel 0.5), or export 32-bit floats";
    case Remedy::kPatchSide:
      return "; allow fewer a patch (--max-side)";
    case Remedy::kImportProxy:
      return "; convert the asset by rbvh proxy --vdm";
    case Remedy::kScanUnits:
      return "; give it in scan units (such as 0.5units), or ingest the scan with --units";
    case Remedy::kMeasure:
      return "; build with --measure, or name the scan with --against";
    case Remedy::kNewLayer:
      return "; --layer-scale is for new ones";
  }
  return "";
}

}  // namespace

std::string error_line(const Error& error) { return error.what() + std::string(words(error.remedy())); }

}  // namespace rbvh
