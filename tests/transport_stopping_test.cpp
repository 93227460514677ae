#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/stopping.h"
#include "tests/transport_tiles.h"
#include "transport/stopping.h"

namespace weft::transport {
namespace {

// One cell of grey fibres and its paths.
class TransportStopping : public testing::Test {
 protected:
  TransportStopping() {
    shading::FibreMaterial material;
    material.c_r = {0.04f, 0.1f, 0.3f};
    material.c_tt = {0.2f, 0.5f, 0.9f};
    material.beta_r = 0.127f;
    material.beta_tt = 0.17f;
    material.gamma_tt = 0.45f;
    materials_.emplace_back(material);
    cell_.segments.resize(tile_.segment_count());
    std::iota(cell_.segments.begin(), cell_.segments.end(), 0u);
    settings_.sh_order = 2;
    settings_.seed = 6;
  }

  [[nodiscard]] TransferSums first(std::uint64_t paths) const {
    return transfer_sums(scene_, materials_, {5, &cell_, 0, paths}, settings_);
  }
  [[nodiscard]] TransferSums to_error(double target, std::uint64_t most,
                                      const Checkpoint& checkpoint = {}) const {
    return transfer_sums_to_error(scene_, materials_, {5, &cell_, 0, most}, settings_, target,
                                  checkpoint);
  }
  [[nodiscard]] static double error_of(const TransferSums& sums) {
    return core::root_mean_square_error({sums.sum, sums.sum_of_squares, sums.paths});
  }

  fabric::Tile tile_ = test::crossed_layers(4, 8, 0.02f, 4);
  Scene scene_{tile_};
  std::vector<shading::FibreBcsdf> materials_;
  CellSegments cell_;
  TransferSettings settings_;
};

TEST_F(TransportStopping, EndsAtTheFirstBlocksThatReachTheTarget) {
  constexpr std::uint64_t kBlock = core::kStoppingBlockPaths;
  const double target = error_of(first(7 * kBlock));
  std::uint64_t expected = core::kFewestStoppingBlocks * kBlock;
  while (error_of(first(expected)) > target) {
    expected += kBlock;
  }
  ASSERT_GT(expected, core::kFewestStoppingBlocks * kBlock);
  const TransferSums found = to_error(target, 50'000);
  EXPECT_EQ(found.paths, expected);
  EXPECT_LE(error_of(found), target);
  // The sums are those of as many paths, to the bit.
  EXPECT_EQ(found.sum, first(expected).sum);
  EXPECT_EQ(found.sum_of_squares, first(expected).sum_of_squares);
}

TEST_F(TransportStopping, HasNoFewerPathsThanTheErrorNeedsToBeKnown) {
  EXPECT_EQ(to_error(1, 50'000).paths, core::kFewestStoppingBlocks * core::kStoppingBlockPaths);
}

TEST_F(TransportStopping, UsesAllPathsWhereTheTargetIsOutOfReach) {
  for (const std::uint64_t most : {1, 700, 1024, 4096, 5000}) {
    const TransferSums found = to_error(1e-9, most);
    EXPECT_EQ(found.paths, most);
    EXPECT_EQ(found.sum, first(most).sum);
    EXPECT_EQ(found.sum_of_squares, first(most).sum_of_squares);
  }
}

// The error that the first four blocks state is that of the cell: it falls as 1 / sqrt(n). Over
// seeds it has a standard deviation of 1.5 %.
TEST_F(TransportStopping, FourBlocksKnowTheirErrorToAFewPercent) {
  settings_.sh_order = 5;
  const double long_run = error_of(first(256 * 256)) * 8;
  EXPECT_NEAR(error_of(first(4 * 256)), long_run, 0.1 * long_run);
}

TEST_F(TransportStopping, CancellationEndsTheWork) {
  int calls = 0;
  const auto cancel = [&] {
    if (++calls == 9) {
      throw core::Error(core::Code::kCancelled, "stop");
    }
  };
  EXPECT_THROW(static_cast<void>(to_error(1e-9, 50'000, cancel)), core::Error);
  EXPECT_EQ(calls, 9);
}

}  // namespace
}  // namespace weft::transport
