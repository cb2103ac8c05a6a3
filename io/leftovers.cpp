#include "io/leftovers.h"

#include <filesystem>

#include "io/hash.h"
#include "io/parts_file.h"
#include "io/posix_file.h"
#include "io/rbvh_file.h"
#include "pipeline/base/error.h"

namespace rbvh {

namespace fs = std::filesystem;

std::vector<std::string> files_of_pair(const std::string& path) {
  std::error_code code;
  if (!fs::is_regular_file(path, code) || is_parts(path)) return {};
  try {
    PairHeader header;
    read_rbvh(path, &header);
    if (hash_file(header.atlas_file) == header.atlas_hash) return {header.atlas_file};
  } catch (const Error&) {  // no pair, or not whole
  }
  return {};
}

std::vector<std::string> files_of_parts(const std::string& path) {
  if (!is_parts(path)) return {};
  std::vector<std::string> files;
  try {
    const fs::path target = follow_link(path);
    const std::string own = target.stem().string() + ".parts-";
    std::error_code code;
    fs::path folder;
    for (const PairPart& part : read_parts(path).parts) {
      const std::string file = part_path(path, part);
      folder = fs::path(file).parent_path();
      const bool is_own = folder.parent_path() == target.parent_path() &&
                          folder.filename().string().starts_with(own) && !fs::is_symlink(folder, code);
      if (!is_own || fs::exists(folder / "lock", code)) return {};
      files.push_back(file);
      files.push_back(atlas_path(file));
    }
    files.push_back((folder / "journal.json").string());
    files.push_back(folder.string());
  } catch (const Error&) {  // a damaged table names nothing
    return {};
  }
  return files;
}

void remove_leftovers(const std::vector<std::string>& paths) {
  std::error_code ignored;
  for (const std::string& path : paths) fs::remove(path, ignored);
}

}  // namespace rbvh
