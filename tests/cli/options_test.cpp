// Every option that a stage's --help names is used with that stage somewhere in tests/cli.
#include <set>
#include <sstream>

#include "tests/run_tool.h"

namespace rbvh {
namespace {

/// The words of `text` that start with "--", up to the next character no option has.
std::set<std::string> options_in(const std::string& text) {
  std::set<std::string> found;
  for (std::size_t at = 0; (at = text.find("--", at)) != std::string::npos;) {
    std::size_t end = at + 2;
    while (end < text.size() && (std::islower(text[end]) || text[end] == '-')) ++end;
    if (end > at + 2) found.insert(text.substr(at, end - at));
    at = end;
  }
  return found;
}

/// The stage's own options, and those that all stages share: the first words of --help's lines.
struct Declared {
  std::set<std::string> own, common;
};

class Options : public ToolTest {
 protected:
  Declared declared(const std::string& stage) const {
    std::istringstream help(tool(stage + " --help").out);
    Declared declared;
    bool is_common = false;
    for (std::string line; std::getline(help, line);) {
      if (!line.starts_with(" ")) is_common = line.starts_with("Common");
      // "  -o,--output FILE REQUIRED   what to write"
      if (!line.starts_with("  -")) continue;
      const std::string name = line.substr(2, line.find(' ', 2) - 2);
      (is_common ? declared.common : declared.own).merge(options_in(name));
    }
    return declared;
  }

  /// The statements of all tests of the command line, each after its file's name, which may name the
  /// stage.
  static std::vector<std::string> statements() {
    std::vector<std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(RBVH_SOURCE "/tests/cli")) {
      std::ifstream in(entry.path());
      const std::string file = entry.path().filename().string();
      std::string statement = file;
      for (std::string line; std::getline(in, line);) {
        statement += line + "\n";
        if (!line.ends_with(";")) continue;
        all.push_back(statement);
        statement = file;
      }
    }
    return all;
  }
};

TEST_F(Options, EveryOneIsTestedWithItsStage) {
  std::istringstream help(tool("--help").out);
  std::set<std::string> stages, common;
  bool is_stage = false;
  for (std::string line; std::getline(help, line);) {
    if (!line.starts_with(" ")) is_stage = line.starts_with("Subcommands");
    if (is_stage && line.starts_with("  ") && line[2] != ' ')
      stages.insert(line.substr(2, line.find(' ', 2) - 2));
  }
  ASSERT_EQ(stages.size(), 17u);
  const std::vector<std::string> tests = statements();
  const auto is_tested = [&](const std::string& stage, const std::string& option) {
    return std::any_of(tests.begin(), tests.end(), [&](const std::string& statement) {
      return statement.find(stage) != std::string::npos && options_in(statement).contains(option);
    });
  };
  for (const std::string& stage : stages) {
    Declared options = declared(stage);
    EXPECT_TRUE(options.own.contains("--help")) << stage;
    options.own.erase("--help");
    for (const std::string& option : options.own)
      EXPECT_TRUE(is_tested(stage, option)) << stage << " " << option;
    common.merge(options.common);
  }
  EXPECT_TRUE(common.contains("--memory"));
  for (const std::string& option : common) EXPECT_TRUE(is_tested("", option)) << option;
}

}  // namespace
}  // namespace rbvh
