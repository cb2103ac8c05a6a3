// What a start of the tool loads: OpenImageIO, with its hundreds of libraries, only where it reads or writes
// a picture.
#include <gtest/gtest.h>

#include "tests/run_tool.h"

namespace rbvh {
namespace {

class Start : public ToolTest {
 protected:
  /// The libraries that a run loads, one a line.
  std::string loaded(const std::string& words) const {
    const std::string log = path("log");
    return shell("LD_DEBUG=files LD_DEBUG_OUTPUT='" + log + "' '" RBVH_TOOL "' " + words +
                 " > /dev/null 2>&1; cat '" + log + "'.* | grep -o 'calling init: .*'; rm '" + log + "'.*")
        .out;
  }
};

constexpr const char* kTetrahedron =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

TEST_F(Start, LoadsOpenImageIoOnlyWhereItIsWanted) {
  write("a.obj", kTetrahedron);
  good("ingest a.obj -o a.ply");
  good("build a.ply --levels Q4 -o a.rbvh");
  for (const std::string words : {"--version", "--help", "build", "devices", "info a.ply", "info a.rbvh",
                                  "validate a.rbvh", "mesh a.rbvh -o b.ply", "render a.rbvh -o a.png"}) {
    const std::string libraries = loaded(words);
    EXPECT_NE(libraries.find("libstdc++"), std::string::npos) << words;
    EXPECT_EQ(libraries.find("OpenImageIO"), std::string::npos) << words;
    EXPECT_EQ(libraries.find("libpcl_filters"), std::string::npos) << words;
    EXPECT_LT(std::count(libraries.begin(), libraries.end(), '\n'), 60) << words;
  }
  EXPECT_NE(loaded("render a.rbvh -o a.jpg").find("OpenImageIO"), std::string::npos);
}

}  // namespace
}  // namespace rbvh
