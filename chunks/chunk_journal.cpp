#include "chunks/chunk_journal.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/input_file.h"
#include "io/output_file.h"
#include "io/shallow_json.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

using nlohmann::ordered_json;

}  // namespace

std::string journal_path(const std::string& folder) {
  return (std::filesystem::path(folder) / kJournalName).string();
}

std::optional<ChunkJournal> read_journal(const std::string& folder, std::uint64_t key) {
  const std::string path = journal_path(folder);
  if (!std::filesystem::exists(path)) return std::nullopt;
  try {
    const InputBytes bytes = read_input(path);
    const nlohmann::json json = parse_shallow_json(bytes.view(), 8);
    if (json.is_discarded() || json.at("key") != key) return std::nullopt;
    ChunkJournal journal;
    journal.key = key;
    journal.area = json.at("area");
    journal.margin = json.at("margin");
    for (const nlohmann::json& cell : json.at("cells")) {
      journal.cells.push_back({cell.at("lo"), cell.at("hi"), cell.at("own")});
      journal.counts.push_back({cell.at("own"), cell.at("near"), cell.at("area")});
    }
    for (const nlohmann::json& part : json.at("parts")) journal.parts.push_back(part_from_json(part, path));
    if (journal.parts.size() > journal.cells.size()) return std::nullopt;
    return journal;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  } catch (const Error&) {
    return std::nullopt;
  }
}

void write_journal(const std::string& folder, const ChunkJournal& journal) {
  ordered_json json = {{"key", journal.key},
                       {"area", journal.area},
                       {"margin", journal.margin},
                       {"cells", ordered_json::array()},
                       {"parts", ordered_json::array()}};
  for (std::size_t i = 0; i < journal.cells.size(); ++i)
    json["cells"].push_back({{"lo", journal.cells[i].lo},
                             {"hi", journal.cells[i].hi},
                             {"own", journal.counts[i].own},
                             {"near", journal.counts[i].near},
                             {"area", journal.counts[i].area}});
  for (const PairPart& part : journal.parts) json["parts"].push_back(part_to_json(part));
  OutputFile file(journal_path(folder), true);
  file.write(json.dump(1) + "\n");
  file.commit();
}

}  // namespace rbvh
