#include <filesystem>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "storage/database_summary.h"
#include "storage/recolouring.h"
#include "tests/storage_test_database.h"

namespace weft::storage {
namespace {

using testing::HasSubstr;

class RecolouringTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string refusal(const std::function<void(Recolouring&)>& damage) const {
    Recolouring recolouring = small_recolouring();
    damage(recolouring);
    try {
      write_database(small_database(), recolouring, path_);
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kDataLoss);
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) /
                                  (std::string("weft_recolouring_") +
                                   testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::path path_ = folder_ / "small.h5";
};

TEST_F(RecolouringTest, WhatIsWritten_IsReadBack) {
  const Recolouring recolouring = small_recolouring();
  write_database(small_database(), recolouring, path_);
  const RecolourableDatabase read = read_recolourable(path_);
  EXPECT_EQ(read.recolouring.order_light, recolouring.order_light);
  EXPECT_EQ(read.recolouring.order_counts, recolouring.order_counts);
  EXPECT_EQ(read.recolouring.order_shapes, recolouring.order_shapes);
  EXPECT_EQ(read.recolouring.carried_over_json, recolouring.carried_over_json);
  EXPECT_EQ(read.database.transfer, small_database().transfer);
  EXPECT_EQ(stored_datasets(path_).size(), 45U);
}

TEST_F(RecolouringTest, AFileWithoutIt_IsReadAsBefore) {
  write_database(small_database(), path_);
  const RecolourableDatabase read = read_recolourable(path_);
  EXPECT_FALSE(read.recolouring.has_orders());
  EXPECT_TRUE(read.recolouring.carried_over_json.empty());
  EXPECT_EQ(stored_datasets(path_).size(), 41U);
  EXPECT_GT(stored_chunks(path_).size(), 0U);
}

TEST_F(RecolouringTest, WhatContradictsTheRest_IsRefused) {
  EXPECT_THAT(refusal([](Recolouring& r) { r.order_light.pop_back(); }), HasSubstr("order_light"));
  EXPECT_THAT(refusal([](Recolouring& r) { r.order_counts.clear(); }), HasSubstr("order_counts"));
  EXPECT_THAT(refusal([](Recolouring& r) { r.order_light[3] = 0xbc00; }), HasSubstr("negative"));
  EXPECT_THAT(refusal([](Recolouring& r) { r.order_shapes[3] = 0x7c00; }), HasSubstr("not finite"));
}

}  // namespace
}  // namespace weft::storage
