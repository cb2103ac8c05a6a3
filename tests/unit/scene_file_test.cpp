// scene.json: what it means, and each way in which it can be wrong.
#include "io/scene_file.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

/// A scene of one file "a" and these instances; `more` goes before the instances.
std::string scene(const std::string& instances, const std::string& more = {}) {
  return R"({"rbvh_scene": 1, "objects": {"a": {"file": "a.ply"}, "b": {"file": "/far/b.rbvh", "level": "Q1"})" +
         more + R"(}, "instances": )" + instances + "}";
}

SceneFile decode(const std::string& text) { return decode_scene(text, "folder/s.json"); }

void expect_refused(const std::string& text, const std::string& part) {
  try {
    decode(text);
    ADD_FAILURE() << "taken: " << text;
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput) << text;
    const std::string what = error.what();
    EXPECT_NE(what.find(part), std::string::npos) << text << "\n" << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    EXPECT_EQ(what.rfind("folder/s.json: ", 0), 0u) << what;
  }
}

void expect_near(Vec3d a, Vec3d b) { EXPECT_LT(length(a - b), 1e-12) << a.x << ' ' << a.y << ' ' << a.z; }

TEST(SceneFile, ObjectsAndPaths) {
  const SceneFile s = decode(scene(R"([{"object": "b"}, {"object": "a"}, {"object": "b"}])"));
  ASSERT_EQ(s.objects.size(), 2u);
  EXPECT_EQ(s.objects[0].path, "folder/a.ply");
  EXPECT_EQ(s.objects[0].level, "");
  EXPECT_EQ(s.objects[1].path, "/far/b.rbvh");
  EXPECT_EQ(s.objects[1].level, "Q1");
  ASSERT_EQ(s.instances.size(), 3u);
  EXPECT_EQ(s.instances[0].object, 1u);
  EXPECT_EQ(s.instances[1].object, 0u);
  EXPECT_EQ(s.instances[2].to_world, Affine{});
  EXPECT_FALSE(s.z_is_up);
}

TEST(SceneFile, TransformsScaleThenRotateThenTranslate) {
  const SceneFile s = decode(scene(
      R"([{"object": "a", "translate": [10, 0, 0], "rotate": {"axis": [0, 0, 2], "degrees": 90}, "scale": [2, 3, 4]},
          {"object": "a", "scale": -1}, {"object": "a", "rotate": {"axis": [1, 0, 0], "degrees": -90}},
          {"object": "a", "matrix": [0, 1, 0, 5, 1, 0, 0, 6, 0, 0, 1, 7]},
          {"object": "a", "matrix": [0, 1, 0, 5, 1, 0, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1]}])"));
  expect_near(s.instances[0].to_world.point({1, 1, 1}), {7, 2, 4});
  expect_near(s.instances[1].to_world.point({1, 2, 3}), {-1, -2, -3});
  expect_near(s.instances[2].to_world.point({1, 2, 3}), {1, 3, -2});
  expect_near(s.instances[3].to_world.point({1, 2, 3}), {7, 7, 10});
  EXPECT_EQ(s.instances[3].to_world, s.instances[4].to_world);
}

TEST(SceneFile, GroupsMoveTogether) {
  const SceneFile s =
      decode(scene(R"([{"object": "g", "translate": [0, 0, 5]}, {"object": "h", "scale": 2}])",
                   R"(, "g": {"group": [{"object": "a", "translate": [1, 0, 0]}, {"object": "b"}]},
           "h": {"group": [{"object": "g", "translate": [0, 1, 0]}]})"));
  ASSERT_EQ(s.instances.size(), 4u);
  expect_near(s.instances[0].to_world.point({0, 0, 0}), {1, 0, 5});
  expect_near(s.instances[2].to_world.point({0, 0, 0}), {2, 2, 0});
  EXPECT_EQ(s.instances[3].object, 1u);
}

TEST(SceneFile, FaultsAreNamed) {
  expect_refused("", "is no JSON");
  expect_refused("{", "is no JSON");
  expect_refused("[1, 2]", "is no JSON object");
  expect_refused("{}", "\"rbvh_scene\": 1");
  expect_refused(R"({"rbvh_scene": 2, "objects": {}, "instances": []})", "version 2");
  expect_refused(R"({"rbvh_scene": 1, "instances": []})", "has no \"objects\"");
  expect_refused(R"({"rbvh_scene": 1, "objects": {}})", "has no \"instances\"");
  expect_refused(R"({"rbvh_scene": 1, "objects": {}, "instances": [], "camera": 1})",
                 "unknown word \"camera\"");
  expect_refused(R"({"rbvh_scene": 1, "up": "+X", "objects": {}, "instances": []})", "up is neither");
  expect_refused(R"({"rbvh_scene": 1, "objects": {"a": {"file": "x"}, "a": {"file": "y"}}, "instances": []})",
                 "twice");
  expect_refused(R"({"rbvh_scene": 1, "objects": {"a": {}}, "instances": []})",
                 "either \"file\" or \"group\"");
  expect_refused(R"({"rbvh_scene": 1, "objects": {"a": {"file": "s.json"}}, "instances": []})",
                 "write it as a group");
  expect_refused(R"({"rbvh_scene": 1, "objects": {"a": {"file": 3}}, "instances": []})", "is no text");
  expect_refused(scene("[]"), "places nothing");
  expect_refused(scene("{}"), "instances is no list");
  expect_refused(scene(R"([{"object": "c"}])"), "instances[0] places \"c\", which is no object");
  expect_refused(scene(R"([{"scale": 1}])"), "does not say which");
  expect_refused(scene(R"([{"object": "a", "sclae": 1}])"), "unknown word \"sclae\"");
  expect_refused(scene(R"([{"object": "a", "scale": 0}])"), "singular");
  expect_refused(scene(R"([{"object": "a", "scale": [1, 0, 1]}])"), "singular");
  expect_refused(scene(R"([{"object": "a", "scale": "2"}])"), "no number");
  expect_refused(scene(R"([{"object": "a", "scale": 1e30}])"), "no number");
  expect_refused(scene(R"([{"object": "a", "matrix": [1, 2, 3, 0, 2, 4, 6, 0, 0, 0, 1, 0]}])"), "singular");
  expect_refused(scene(R"([{"object": "a", "matrix": [1, 2, 3]}])"), "12 numbers");
  expect_refused(scene(R"([{"object": "a", "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,2]}])"), "last row");
  expect_refused(scene(R"([{"object": "a", "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0], "scale": 2}])"), "both");
  expect_refused(scene(R"([{"object": "a", "rotate": 30}])"), "\"axis\" and \"degrees\"");
  expect_refused(scene(R"([{"object": "a", "rotate": {"axis": [0, 0, 0], "degrees": 30}}])"),
                 "without direction");
  expect_refused(scene(R"([{"object": "a", "translate": [1, 2]}])"), "3 numbers");
  expect_refused(scene(R"([{"object": "a"}])", R"(, "g": {"group": [{"object": "g"}]})"),
                 "group \"g\" contains itself");
  expect_refused(scene(R"([{"object": "a"}])",
                       R"(, "g": {"group": [{"object": "h"}]}, "h": {"group": [{"object": "g"}]})"),
                 "contains itself");
  expect_refused(scene(R"([{"object": "a"}])", R"(, "g": {"group": [{"object": "gone"}]})"),
                 "places \"gone\"");
  expect_refused(scene(R"([{"object": "a"}])", R"(, "g": {"group": [], "level": "Q0"})"), "is a group");
}

TEST(SceneFile, GroupsThatMultiplyAreBounded) {
  // 2^30 instances in a kilobyte.
  std::string groups;
  for (int i = 0; i < 30; ++i) {
    const std::string inner = i == 0 ? "a" : "g" + std::to_string(i - 1);
    groups += R"(, "g)" + std::to_string(i) + R"(": {"group": [{"object": ")" + inner +
              R"("}, {"object": ")" + inner + R"("}]})";
  }
  expect_refused(scene(R"([{"object": "g29"}])", groups), "more than a million");
  expect_refused(std::string(1000, '['), "deep");
}

// Groups one in the other.
std::string chain_of_groups(int groups, bool outermost_first) {
  std::string chain;
  const auto name = [&](int i) {
    return "g" + std::to_string(1000 + (outermost_first ? i : groups - 1 - i));
  };
  for (int i = 0; i < groups; ++i) {
    const std::string inner = i + 1 < groups ? name(i + 1) : "a";
    chain += ", \"" + name(i) + R"(": {"group": [{"object": ")" + inner + R"("}]})";
  }
  return scene("[{\"object\": \"" + name(0) + "\"}]", chain);
}

TEST(SceneFile, DepthIsWhatItIsWhateverTheNames) {
  for (const bool outermost_first : {true, false}) {
    EXPECT_EQ(decode(chain_of_groups(64, outermost_first)).instances.size(), 1u);
    expect_refused(chain_of_groups(65, outermost_first), "64 groups deep");
    expect_refused(chain_of_groups(300, outermost_first), "64 groups deep");
  }
}

TEST(SceneFile, TheDocumentsExampleIsRead) {
  std::ifstream file(RBVH_SOURCE "/docs/scene.md");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const std::size_t begin = text.find("```json\n") + 8, end = text.find("```", begin);
  const SceneFile s = decode(text.substr(begin, end - begin));
  EXPECT_EQ(s.instances.size(), 3u);
}

}  // namespace
}  // namespace rbvh
