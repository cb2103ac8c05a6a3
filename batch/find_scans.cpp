#include "batch/find_scans.h"

#include <glob.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "io/scan_io.h"
#include "pipeline/base/error.h"
#include "pipeline/base/words.h"

namespace rbvh {
namespace {

namespace fs = std::filesystem;

// The pattern's files, sorted; a name that exists is none, whatever it is made of.
std::vector<std::string> expand(const std::string& input) {
  std::error_code code;
  if (fs::exists(input, code)) return {input};
  glob_t found{};
  std::vector<std::string> paths;
  if (glob(input.c_str(), 0, nullptr, &found) == 0)
    paths.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  globfree(&found);
  if (paths.empty())
    throw Error(ErrorKind::kInput, input, "there is no such file or folder, and as a pattern it fits none");
  return paths;
}

bool is_hidden(const fs::path& path) { return path.filename().string().starts_with('.'); }

void add_folder(const fs::path& folder, const fs::path& output, FoundScans& found) {
  std::error_code code;
  fs::recursive_directory_iterator at(folder, code), end;
  for (; !code && at != end; at.increment(code)) {
    const fs::path& path = at->path();
    if (is_hidden(path) || (at->is_directory(code) && fs::equivalent(path, output, code))) {
      at.disable_recursion_pending();
      continue;
    }
    if (!at->is_regular_file(code)) continue;
    if (has_scan_extension(path.string()))
      found.scans.push_back({path.string(), fs::relative(path, folder, code).string()});
    else
      ++found.others;
  }
  if (code) throw Error(ErrorKind::kInput, folder.string(), "cannot be read: " + code.message());
}

}  // namespace

FoundScans find_scans(const std::vector<std::string>& inputs, const std::string& output) {
  FoundScans found;
  for (const std::string& input : inputs)
    for (const std::string& path : expand(input)) {
      std::error_code code;
      if (fs::is_directory(path, code))
        add_folder(path, output, found);
      else
        found.scans.push_back({path, fs::path(path).filename().string()});
    }
  for (BatchScan& scan : found.scans) scan.path = fs::absolute(scan.path).string();
  std::map<std::string, int> same;
  const auto stem = [](const BatchScan& scan) { return fs::path(scan.name).replace_extension().string(); };
  for (const BatchScan& scan : found.scans) ++same[stem(scan)];
  for (BatchScan& scan : found.scans)
    if (same[stem(scan)] == 1) scan.name = stem(scan);
  std::sort(found.scans.begin(), found.scans.end(),
            [](const BatchScan& a, const BatchScan& b) { return a.name < b.name; });
  const auto twice =
      std::adjacent_find(found.scans.begin(), found.scans.end(),
                         [](const BatchScan& a, const BatchScan& b) { return a.name == b.name; });
  if (twice != found.scans.end())
    throw Error(ErrorKind::kUsage, twice->path,
                "would have the outputs of " + std::next(twice)->path +
                    "; give the folder that both are in, or another name");
  return found;
}

Shard parse_shard(std::string_view text) {
  const std::size_t slash = std::min(text.find('/'), text.size());
  const int index = parse_positive(text.substr(0, slash));
  const int count = parse_positive(text.substr(std::min(slash + 1, text.size())));
  if (index > count)
    throw Error(ErrorKind::kUsage, "", "'" + std::string(text) + "' is not I/N with I up to N");
  return {static_cast<std::size_t>(index), static_cast<std::size_t>(count)};
}

std::vector<BatchScan> shard(const std::vector<BatchScan>& scans, const Shard& part) {
  std::vector<BatchScan> chosen;
  for (std::size_t i = part.index - 1; i < scans.size(); i += part.count) chosen.push_back(scans[i]);
  return chosen;
}

}  // namespace rbvh
