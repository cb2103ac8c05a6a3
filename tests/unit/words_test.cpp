#include "pipeline/base/words.h"

#include <gtest/gtest.h>

#include <functional>

#include "io/name_template.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

bool is_refused(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.kind() == ErrorKind::kUsage;
  }
  return false;
}

constexpr std::pair<std::string_view, int> kChoices[] = {{"one", 1}, {"two", 2}};

TEST(Words, NumbersInARangeAndChoices) {
  EXPECT_EQ(parse_between("0.5", 0, 1), 0.5);
  EXPECT_EQ(parse_above_zero("1e-3"), 1e-3);
  for (const char* text : {"-0.1", "1.5", "nan", ""})
    EXPECT_TRUE(is_refused([text] { parse_between(text, 0, 1); })) << text;
  for (const char* text : {"0", "-1", "nan"})
    EXPECT_TRUE(is_refused([text] { parse_above_zero(text); })) << text;
  EXPECT_EQ(parse_distance("0"), 0);
  for (const char* text : {"-1", "nan", "inf"})
    EXPECT_TRUE(is_refused([text] { parse_distance(text); })) << text;
  EXPECT_EQ(parse_choice<kChoices>("two"), 2);
  EXPECT_TRUE(is_refused([] { parse_choice<kChoices>("three"); }));
}

TEST(Words, Numbers) {
  EXPECT_EQ(parse_number("-1.5e-3"), -1.5e-3);
  EXPECT_EQ(parse_number("+2"), 2);
  for (const char* word : {"", " 1", "1 ", "1x", "nan", "inf", "-inf", "1,5", "0x10", "+-1", "1e999", "--1"})
    EXPECT_TRUE(is_refused([&] { parse_number(word); })) << word;
}

TEST(Words, WholeNumbers) {
  EXPECT_EQ(parse_integer_between("-3", -3, 5), -3);
  for (const char* word : {"-4", "6", "1.0", "", "99999999999"})
    EXPECT_TRUE(is_refused([&] { parse_integer_between(word, -3, 5); })) << word;
  EXPECT_EQ(parse_positive("12"), 12);
  for (const char* word : {"0", "-1", "1.0", "99999999999", ""})
    EXPECT_TRUE(is_refused([&] { parse_positive(word); })) << word;
}

TEST(Words, Vectors) {
  EXPECT_EQ(parse_vec3("-1,0.5,2e1"), (Vec3d{-1, 0.5, 20}));
  for (const char* word :
       {"1,2", "1,2,3,4", "1,,3", "0,1,,2", "1,2,nan", "1, 2,3", "1;2;3", ",1,2", "1,2,3,"})
    EXPECT_TRUE(is_refused([&] { parse_vec3(word); })) << word;
}

TEST(Words, Resolutions) {
  EXPECT_EQ(parse_resolution("640,480").width, 640u);
  EXPECT_EQ(parse_resolution("640,480").height, 480u);
  for (const char* word : {"640", "640x480", "0,480", "640,-1", "640,65537", "1.5,2", "4294967297,1"})
    EXPECT_TRUE(is_refused([&] { parse_resolution(word); })) << word;
}

TEST(Words, Axes) {
  EXPECT_EQ(parse_axis("+Z"), (Vec3d{0, 0, 1}));
  EXPECT_EQ(parse_axis("-x"), (Vec3d{-1, 0, 0}));
  EXPECT_EQ(parse_axis("Y"), (Vec3d{0, 1, 0}));
  for (const char* word : {"", "+", "W", "XY", "+-Z"})
    EXPECT_TRUE(is_refused([&] { parse_axis(word); })) << word;
}

TEST(Words, Sizes) {
  EXPECT_EQ(parse_bytes("1500"), 1500u);
  EXPECT_EQ(parse_bytes("64K"), 65536u);
  EXPECT_EQ(parse_bytes("1.5g"), 3u << 29);
  EXPECT_EQ(parse_bytes("2GiB"), 2ull << 30);
  EXPECT_EQ(parse_bytes("2GB"), 2ull << 30);
  for (const char* word : {"", "0", "-1", "G", "1X", "nan", "1iB", "1e30T", "1 G"})
    EXPECT_TRUE(is_refused([&] { parse_bytes(word); })) << word;
}

TEST(Words, Lists) {
  EXPECT_EQ(parse_list("Q0,Q2"), (std::vector<std::string>{"Q0", "Q2"}));
  for (const char* word : {"", "Q0,", ",Q0", "Q0,,Q1"})
    EXPECT_TRUE(is_refused([&] { parse_list(word); })) << word;
}

TEST(NameTemplate, FillsItsFields) {
  const NameTemplate names("out/{name}-{level}-{frame:03}.png");
  EXPECT_EQ(names.fill("dragon", "Q2", 7), "out/dragon-Q2-007.png");
  EXPECT_EQ(NameTemplate("{frame}.png").fill("", "", 12), "12.png");
  EXPECT_EQ(NameTemplate("{frame:01}.png").fill("", "", 12), "12.png");
  EXPECT_EQ(NameTemplate("plain.png").fill("a", "b", 0), "plain.png");
  EXPECT_TRUE(names.has("level"));
  EXPECT_FALSE(NameTemplate("a{name}").has("frame"));
}

TEST(NameTemplate, RefusesWhatItDoesNotKnow) {
  for (const char* word :
       {"{nam}", "{name", "name}", "{}", "{frame:3}", "{frame:00}", "{frame:0x}", "{{name}}"})
    EXPECT_TRUE(is_refused([&] { NameTemplate{word}; })) << word;
}

}  // namespace
}  // namespace rbvh
