// What is done to each scan of a batch: a chain of stages, as a manifest states it.
//
//   {"inputs": ["scans", "more/*.ply"],
//    "steps": [{"stage": "ingest", "options": ["--units", "mm"]},
//              {"stage": "build", "options": ["--levels", "Q2,Q4"]},
//              {"stage": "render", "input": "{ingest}", "output": "{name}-exact.png"},
//              {"stage": "validate", "options": ["--against", "{ingest}", "--json"]}]}
//
// A step reads what the last step that made an asset wrote (the first one, the scan itself). "{name}" is the
// scan's name, "{source}" its path, "{build}" what the step of that name wrote.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace rbvh {

struct ChainStep {
  std::string name;  ///< unique in its chain; the stage's, unless it states one
  std::string stage;
  std::string input;  ///< with fields
  std::string
      output;  ///< with fields, a name in the output folder; may keep {level} and {frame}, for the stage
  std::vector<std::string> options;  ///< words with fields
};

struct Chain {
  std::vector<std::string>
      inputs;  ///< files, folders, patterns (glob); relative ones to the manifest's folder
  std::vector<ChainStep> steps;
};

/// Ingest, build, and a picture of the pair.
Chain default_chain();

/// From the bytes of a manifest, which may be hostile; `path` names it in messages. Throws Error(kInput) for
/// what is none: JSON that is cut or has unknown keys, a step that is no stage for batches, a field that no
/// earlier step fills, two steps of one name or output.
Chain decode_chain(std::string_view bytes, const std::string& path);

/// Of a file.
Chain read_chain(const std::string& path);

/// The stage writes to standard output, not to a file that is named.
bool prints(const ChainStep& step);

/// The stage has --report.
bool reports(const ChainStep& step);

/// The stage has --device.
bool uses_device(const ChainStep& step);

/// `text` with its fields replaced: "name", "source" and steps' names are keys of `values`. Others stay.
std::string fill_fields(std::string_view text, const std::map<std::string, std::string>& values);

/// The names of the fields in `text`, without {level} and {frame}.
std::vector<std::string> fields_of(std::string_view text);

}  // namespace rbvh
