#include "pipeline/device/kernel_source.h"

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>

#include "pipeline/base/error.h"
#include "pipeline/device/embedded_kernels.h"

namespace rbvh {
namespace {

constexpr int kMaxIncludeDepth = 16;

std::optional<std::string> find_text(const std::string& name) {
  if (const char* folder = std::getenv("RBVH_KERNELS"); folder != nullptr && *folder != '\0') {
    std::ifstream file(std::string(folder) + "/" + name, std::ios::binary);
    if (file) return std::string(std::istreambuf_iterator<char>(file), {});
  }
  for (std::size_t i = 0; i < kEmbeddedKernelCount; ++i) {
    if (name == kEmbeddedKernels[i].name) return kEmbeddedKernels[i].text;
  }
  return std::nullopt;
}

/// The path below kernels/ that an `#include "kernels/..."` line names; empty for any other line.
std::string included_name(std::string_view line) {
  const auto skip_spaces = [&] { line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size())); };
  skip_spaces();
  if (!line.starts_with('#')) return {};
  line.remove_prefix(1);
  skip_spaces();
  if (!line.starts_with("include")) return {};
  line.remove_prefix(7);
  skip_spaces();
  if (!line.starts_with('"')) return {};
  line.remove_prefix(1);
  std::string_view path = line.substr(0, line.find('"'));
  if (constexpr std::string_view kRoot = "kernels/"; path.starts_with(kRoot))
    path.remove_prefix(kRoot.size());
  return std::string(path);
}

void expand(const std::string& name, const std::string& includer, int depth, std::string& out) {
  const std::optional<std::string> text = find_text(name);
  if (!text || depth > kMaxIncludeDepth) {
    throw Error(ErrorKind::kDevice, "kernels/" + name,
                (text ? "included too deep, by kernels/" : "no such kernel file, wanted by ") + includer +
                    "; check RBVH_KERNELS if it is set");
  }
  out += "#line 1 \"kernels/" + name + "\"\n";
  std::istringstream lines(*text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const std::string included = included_name(line);
    if (included.empty()) {
      out += line + '\n';
    } else {
      expand(included, "kernels/" + name, depth + 1, out);
      out += "#line " + std::to_string(number + 1) + " \"kernels/" + name + "\"\n";
    }
  }
}

}  // namespace

std::string kernel_source(std::string_view name) {
  std::string out;
  expand(std::string(name), "the program", 0, out);
  return out;
}

}  // namespace rbvh
