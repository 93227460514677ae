#include <filesystem>

#include <gtest/gtest.h>

#include "storage/database_diff.h"
#include "tests/storage_test_database.h"

namespace weft::storage {
namespace {

class DatabaseDiffTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::map<std::string, DatasetDifference> diff(const FabricDatabase& from,
                                                const FabricDatabase& to) {
    write_database(from, folder_ / "from.h5");
    write_database(to, folder_ / "to.h5");
    std::map<std::string, DatasetDifference> differences;
    for (const DatasetDifference& d : diff_databases(folder_ / "from.h5", folder_ / "to.h5")) {
      differences[d.path] = d;
    }
    return differences;
  }
  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) /
                                  (std::string("weft_database_diff_") +
                                   testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(DatabaseDiffTest, NamesWhatDiffersAndByHowMuch) {
  const FabricDatabase from = small_database();
  FabricDatabase to = from;
  to.points_mm[4] += 0.25F;
  to.description_json = "{\"name\": \"another\"}";
  const auto differences = diff(from, to);
  int different = 0;
  for (const auto& [path, difference] : differences) {
    different += difference.is_equal ? 0 : 1;
    EXPECT_EQ(difference.shape_from, difference.shape_to) << path;
    EXPECT_FALSE(difference.shape_from.empty()) << path;
  }
  EXPECT_EQ(different, 2);
  const DatasetDifference& points = differences.at("/exemplar/points_mm");
  EXPECT_NEAR(points.largest, 0.25, 1e-6);
  EXPECT_NEAR(points.rms, 0.25 / std::sqrt(static_cast<double>(from.points_mm.size())), 1e-6);
  EXPECT_GT(points.rms_from, 0);
  EXPECT_FALSE(differences.at("/provenance/description").is_equal);
  EXPECT_EQ(description_json(folder_ / "to.h5"), to.description_json);
}

TEST_F(DatabaseDiffTest, ComparesHalvesWithFloats) {
  FabricDatabase from = small_database();
  from.transfer.assign(from.transfer.size(), 0.1F);  // no half
  // Errors so large that halves are exact enough, and so small that they are not.
  from.transfer_se.assign(from.transfer_se.size(), 1.0F);
  FabricDatabase to = from;
  to.transfer_se.assign(to.transfer_se.size(), 0.0F);
  const auto differences = diff(from, to);
  const DatasetDifference& transfer = differences.at("/iirtf/transfer");
  EXPECT_FALSE(transfer.is_equal) << "they are stored otherwise";
  EXPECT_GT(transfer.largest, 0);
  EXPECT_LT(transfer.largest, 1e-3);
  EXPECT_NEAR(differences.at("/iirtf/standard_error").largest, 1, 1e-9);
}

TEST_F(DatabaseDiffTest, OtherShapes_AreNotCompared) {
  const FabricDatabase from = small_database();
  FabricDatabase to = from;
  to.yarn_names.push_back("weft");
  const DatasetDifference yarns = diff(from, to).at("/exemplar/yarn_names");
  EXPECT_FALSE(yarns.is_equal);
  EXPECT_EQ(yarns.shape_from, h5::Shape{1});
  EXPECT_EQ(yarns.shape_to, h5::Shape{2});
}

}  // namespace
}  // namespace weft::storage
