// Exact methods as people name them.
#include "pipeline/trace/exact_words.h"

#include <gtest/gtest.h>

#include "tests/usage_refusal.h"

namespace rbvh {
namespace {

TEST(ExactWords, AreTheTablesNames) {
  for (const ExactBuilderInfo& row : kExactBuilders) EXPECT_EQ(parse_exact_builder(row.name), row.builder);
  for (const ExactTraversalInfo& row : kExactTraversals)
    EXPECT_EQ(parse_exact_traversal(row.name), row.traversal);
  EXPECT_EQ(usage_refusal([] { parse_exact_builder("lbv"); }),
            "'lbv' is none of sah-binned, sah, ploc, lbvh, kd");
  EXPECT_NE(usage_refusal([] { parse_exact_traversal(""); }).find("'' is none of wide16, "),
            std::string::npos);
}

TEST(ExactWords, ComparedAreTwo) {
  EXPECT_EQ(parse_two_traversals("wide16,kd-stack"),
            (std::vector<ExactTraversal>{ExactTraversal::kWide16, ExactTraversal::kKdStack}));
  for (const char* text : {"wide16", "wide16,kd-stack,bvh-stack", "wide16,", "wide16,kd"})
    EXPECT_NE(usage_refusal([&] { parse_two_traversals(text); }), "") << text;
}

TEST(ExactWords, BuilderFitsTraversal) {
  EXPECT_EQ(exact_config({}, {}).traversal, ExactTraversal::kWide16);
  EXPECT_EQ(exact_config({}, {}).builder, ExactBuilder::kSahBinned);
  EXPECT_EQ(exact_config(ExactTraversal::kKdStack, {}).builder, ExactBuilder::kKd);
  EXPECT_EQ(exact_config({}, ExactBuilder::kPloc).builder, ExactBuilder::kPloc);
  EXPECT_EQ(usage_refusal([] { exact_config(ExactTraversal::kWide16, ExactBuilder::kKd); }),
            "builder kd does not fit tracer wide16; there are sah-binned, sah, ploc, lbvh");
  EXPECT_NE(usage_refusal([] { exact_config(ExactTraversal::kKdStack, ExactBuilder::kSah); }), "");
}

}  // namespace
}  // namespace rbvh
