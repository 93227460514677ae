#include <gtest/gtest.h>

#include "coordinator/versions/description_changes.h"
#include "tests/coordinator_fabric.h"

namespace weft::coordinator {
namespace {

std::vector<std::string> lines_of(const v1::FabricDescription& from,
                                  const v1::FabricDescription& to) {
  std::vector<std::string> lines;
  for (const FieldDifference& d : differences_of(from, to)) {
    lines.push_back(d.path + ": " + d.from + " -> " + d.to);
  }
  return lines;
}

TEST(DescriptionChanges, NameFieldsByTheirPath) {
  const v1::FabricDescription from = small_description();
  EXPECT_TRUE(lines_of(from, from).empty());
  v1::FabricDescription to = from;
  to.mutable_materials(0)->mutable_c_tt()->set_r(0.25);
  to.mutable_materials(0)->set_name("red");
  to.mutable_weave()->set_ends_per_cm(21);
  const std::vector<std::string> lines = lines_of(from, to);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_NE(std::find(lines.begin(), lines.end(), "materials[0].c_tt.r: 0.8 -> 0.25"), lines.end());
  EXPECT_NE(std::find(lines.begin(), lines.end(), "weave.ends_per_cm: 20 -> 21"), lines.end());
  EXPECT_NE(std::find(lines.begin(), lines.end(), "materials[0].name: \"white\" -> \"red\""),
            lines.end());
}

TEST(DescriptionChanges, SayWhatCameAndWent) {
  const v1::FabricDescription from = small_description();
  v1::FabricDescription to = from;
  to.add_materials()->set_name("new");
  to.clear_yarns();
  const std::vector<FieldDifference> found = differences_of(from, to);
  ASSERT_EQ(found.size(), 2U);
  for (const FieldDifference& d : found) {
    if (d.path == "materials[1]") {
      EXPECT_EQ(d.from, "");
      EXPECT_NE(d.to.find("new"), std::string::npos);
    } else {
      EXPECT_EQ(d.path, "yarns[0]");
      EXPECT_EQ(d.to, "");
      EXPECT_NE(d.from.find("cotton"), std::string::npos);
    }
  }
}

TEST(DescriptionChanges, AreLimitedInNumberAndLength) {
  v1::FabricDescription from = small_description();
  v1::FabricDescription to = from;
  for (int i = 0; i < 3'000; ++i) {
    to.add_materials()->set_name(std::string(5'000, 'x'));
  }
  const std::vector<FieldDifference> found = differences_of(from, to);
  EXPECT_EQ(found.size(), kFieldDifferencesLimit);
  EXPECT_LT(found.front().to.size(), 300U);
}

}  // namespace
}  // namespace weft::coordinator
