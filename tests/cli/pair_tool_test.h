// The tool on pairs: what they hold and how many bytes they take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/run_tool.h"

namespace rbvh {

using Json = nlohmann::json;

class PairToolTest : public ToolTest {
 protected:
  Json info(const std::string& file) const {
    const ToolRun run = tool("info --json " + file);  // which checks it as validate does
    EXPECT_EQ(run.code, 0) << run.err;
    return Json::parse(run.out, nullptr, false);
  }
  std::uintmax_t bytes(const std::string& stem) const {
    return std::filesystem::file_size(path(stem + ".rbvh")) +
           std::filesystem::file_size(path(stem + ".atlas.tif"));
  }
};

}  // namespace rbvh
