#include <gtest/gtest.h>

#include "core/half.h"
#include "storage/reduce.h"

namespace weft::storage {
namespace {

// Entries that tell where they stood: two cells of order 2, three segments, two by two pixels.
FabricDatabase numbered() {
  FabricDatabase db;
  db.sh_order = 2;
  for (int i = 0; i < 2 * 3 * 9 * 9; ++i) {
    db.transfer.push_back(static_cast<float>(i));
    db.transfer_se.push_back(static_cast<float>(-i));
  }
  for (int i = 0; i < 3 * 512 * 9; ++i) {
    db.c_s.push_back(static_cast<float>(i));
  }
  db.visibility_resolution = 2;
  db.pca_components = 3;
  db.ssdf_mean = {1, 2, 3, 4};
  for (int i = 0; i < 12; ++i) {
    db.ssdf_basis.push_back(static_cast<float>(i));
  }
  for (int i = 0; i < 9; ++i) {
    db.ssdf.push_back(static_cast<std::uint16_t>(i));
  }
  return db;
}

TEST(Reduce, ALowerOrderIsTheUpperLeftCornerOfEveryMatrix) {
  const FabricDatabase whole = numbered();
  const FabricDatabase db = with_sh_order(whole, 1);
  EXPECT_EQ(db.sh_order, 1U);
  ASSERT_EQ(db.transfer.size(), 2U * 3 * 4 * 4);
  ASSERT_EQ(db.transfer_se.size(), db.transfer.size());
  ASSERT_EQ(db.c_s.size(), 3U * 512 * 4);
  for (std::size_t matrix = 0; matrix < 6; ++matrix) {
    for (std::size_t row = 0; row < 4; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        const float expected = whole.transfer[matrix * 81 + row * 9 + column];
        EXPECT_EQ(db.transfer[matrix * 16 + row * 4 + column], expected);
        EXPECT_EQ(db.transfer_se[matrix * 16 + row * 4 + column], -expected);
      }
    }
  }
  EXPECT_EQ(db.c_s[4 * 700 + 3], whole.c_s[9 * 700 + 3]);
  EXPECT_EQ(with_sh_order(whole, 2).transfer, whole.transfer);
}

TEST(Reduce, FewerComponentsAreTheFirstOfEverySegment) {
  const FabricDatabase db = with_components(numbered(), 2);
  EXPECT_EQ(db.pca_components, 2U);
  EXPECT_EQ(db.ssdf_basis, (std::vector<float>{0, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(db.ssdf, (std::vector<std::uint16_t>{0, 1, 3, 4, 6, 7}));
  EXPECT_TRUE(with_components(numbered(), 0).ssdf.empty());
}

TEST(Reduce, HalfPrecisionRounds) {
  FabricDatabase db = numbered();
  db.transfer[5] = 1 + 0x1p-12f;
  db.c_s[7] = 3.14159f;
  db = in_half_precision(std::move(db));
  EXPECT_EQ(db.transfer[5], 1.0f);
  EXPECT_EQ(db.c_s[7], core::float_from_half(core::half_from_float(3.14159f)));
  EXPECT_NE(db.c_s[7], 3.14159f);
}

}  // namespace
}  // namespace weft::storage
