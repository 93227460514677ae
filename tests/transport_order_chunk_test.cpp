#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "core/moments.h"
#include "shading/scattering_orders.h"
#include "tests/transport_tiles.h"
#include "transport/transfer.h"

namespace weft::transport {
namespace {

using shading::kFirstOrder;
using shading::kOrderBins;

// Crossed layers of two materials, strand by strand.
fabric::Tile two_materials() {
  fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  tile.material_names = {"bright", "dark"};
  for (std::size_t s = 0; s < tile.strands.size(); ++s) {
    tile.strands[s].material = s % 2;
  }
  return tile;
}

std::vector<shading::FibreBcsdf> bcsdfs() {
  shading::FibreMaterial bright;
  bright.c_r = {0.04f, 0.1f, 0.3f};
  bright.c_tt = {0.2f, 0.5f, 0.9f};
  bright.beta_r = 0.127f;
  bright.beta_tt = 0.17f;
  shading::FibreMaterial dark = bright;
  dark.c_tt = {0.1f, 0.4f, 0.3f};
  return {shading::FibreBcsdf(bright), shading::FibreBcsdf(dark)};
}

struct Numbers {
  TransferSums sums;
  // [groups, bins, 3, 1 + counts]
  [[nodiscard]] double at(std::size_t group, std::size_t bin, std::size_t colour,
                          std::size_t k) const {
    return core::from_fixed_point(
        sums.order_numbers[((group * kOrderBins + bin) * 3 + colour) * 6 + k]);
  }
};

Numbers trace(std::uint32_t order, std::uint32_t longest = 10000) {
  const fabric::Tile tile = two_materials();
  const Scene scene(tile);
  CellSegments segments;
  segments.segments.resize(tile.segment_count());
  std::iota(segments.segments.begin(), segments.segments.end(), 0u);
  TransferSettings settings;
  settings.sh_order = order;
  settings.max_path_length = longest;
  settings.seed = 5;
  return {transfer_sums(scene, bcsdfs(), {0, &segments, 0, 8192}, settings)};
}

TEST(TransportOrderChunk, OrderBins_HoldTheOrdersTheySay) {
  for (std::uint32_t n = 1; n < 100; ++n) {
    const std::size_t bin = shading::order_bin(n);
    EXPECT_GE(n, kFirstOrder[bin]);
    if (bin + 1 < kOrderBins) {
      EXPECT_LT(n, kFirstOrder[bin + 1]);
    }
  }
  EXPECT_EQ(shading::order_bin(1000000), kOrderBins - 1);
}

TEST(TransportOrderChunk, LightOfAllOrders_IsTheLightOfTheMatrix) {
  const Numbers found = trace(2);
  for (std::size_t c = 0; c < 3; ++c) {
    double light = 0;
    for (std::size_t group = 0; group < 4; ++group) {
      for (std::size_t bin = 0; bin < kOrderBins; ++bin) {
        light += found.at(group, bin, c, 0);
      }
    }
    const double entry = core::from_fixed_point(found.sums.sum[c * 81]);  // of Y_0 and Y_0
    EXPECT_NEAR(light / (4 * std::numbers::pi), entry, 1e-4 * entry);
  }
}

TEST(TransportOrderChunk, Counts_AddUpToTheScatterings) {
  const Numbers found = trace(0);
  for (std::size_t group = 0; group < 4; ++group) {
    for (std::size_t bin = 0; bin < kOrderBins; ++bin) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double light = found.at(group, bin, c, 0);
        const double scatterings = found.at(group, bin, c, 1);
        double counted = 0;
        for (std::size_t k = 2; k < 6; ++k) {
          counted += found.at(group, bin, c, k);
        }
        EXPECT_GE(scatterings, kFirstOrder[bin] * light * (1 - 1e-6));
        EXPECT_LE(counted, scatterings * (1 + 1e-6) + 1e-6);
        EXPECT_GE(counted, 0.5 * scatterings);  // the rest is grazing
        // Of the first and third group all scatterings are one material's.
        if (group % 2 == 0) {
          EXPECT_EQ(found.at(group, bin, c, group == 0 ? 4 : 2), 0);
          EXPECT_EQ(found.at(group, bin, c, group == 0 ? 5 : 3), 0);
        }
      }
    }
  }
  EXPECT_GT(found.at(0, 0, 0, 0), 0);
  EXPECT_GT(found.at(1, 1, 0, 0), 0);
}

TEST(TransportOrderChunk, PathsOfOneScattering_HaveNoShapes) {
  const Numbers once = trace(3, 1);
  for (const std::int64_t entry : once.sums.order_shapes) {
    EXPECT_EQ(entry, 0);
  }
  EXPECT_EQ(once.at(0, 1, 0, 0), 0);
  // Two or more: the matrix is that of one and the shapes, in the mean of the channels.
  const Numbers all = trace(3);
  double beyond = 0;
  for (std::size_t k = 0; k < shading::kOrderShapes; ++k) {
    beyond += core::from_fixed_point(all.sums.order_shapes[k * 256]);
  }
  double bins = 0;
  for (std::size_t group = 0; group < 4; ++group) {
    for (std::size_t bin = 1; bin < kOrderBins; ++bin) {
      for (std::size_t c = 0; c < 3; ++c) {
        bins += all.at(group, bin, c, 0) / 3;
      }
    }
  }
  EXPECT_NEAR(beyond, bins / (4 * std::numbers::pi), 1e-4 * beyond);
}

TEST(TransportOrderChunk, ThePapersEstimator_CountsNothing) {
  const fabric::Tile tile = two_materials();
  const Scene scene(tile);
  CellSegments segments;
  segments.segments = {0, 1, 2};
  TransferSettings settings;
  settings.estimator = Estimator::kLight;
  const TransferSums sums = transfer_sums(scene, bcsdfs(), {0, &segments, 0, 512}, settings);
  EXPECT_TRUE(sums.order_numbers.empty());
  EXPECT_TRUE(sums.order_shapes.empty());
}

}  // namespace
}  // namespace weft::transport
