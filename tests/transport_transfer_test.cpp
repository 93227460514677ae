#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/moments.h"
#include "shading/spherical_harmonics.h"
#include "tests/transport_tiles.h"
#include "transport/bake_point.h"
#include "transport/path.h"
#include "transport/sphere.h"
#include "transport/transfer.h"

namespace weft::transport {
namespace {

constexpr double kPi = std::numbers::pi;

// The fleece of Khungurn et al. 2015, nearly: wide lobes, one channel each dark, grey and bright.
shading::FibreMaterial wide_material() {
  shading::FibreMaterial material;
  material.c_r = {0.04f, 0.1f, 0.3f};
  material.c_tt = {0.2f, 0.5f, 0.9f};
  material.beta_r = 0.127f;
  material.beta_tt = 0.17f;
  material.gamma_tt = 0.45f;
  return material;
}

CellSegments all_segments(const fabric::Tile& tile) {
  CellSegments cell;
  cell.segments.resize(tile.segment_count());
  std::iota(cell.segments.begin(), cell.segments.end(), 0u);
  return cell;
}

struct Matrix {
  std::vector<core::MeanAndError> entries;  // [3, j1, j0]
  std::size_t coefficients = 0;

  [[nodiscard]] const core::MeanAndError& at(std::size_t colour, std::size_t j1,
                                             std::size_t j0) const {
    return entries[(colour * coefficients + j1) * coefficients + j0];
  }
};

Matrix estimate(const Scene& scene, const shading::FibreBcsdf& bcsdf,
                const TransferSettings& settings, std::uint64_t paths) {
  const CellSegments segments = all_segments(scene.tile());
  const std::vector<shading::FibreBcsdf> materials{bcsdf};
  const TransferSums sums = transfer_sums(scene, materials, {0, &segments, 0, paths}, settings);
  EXPECT_EQ(sums.paths, paths);
  Matrix matrix;
  matrix.coefficients = (settings.sh_order + 1) * (settings.sh_order + 1);
  for (std::size_t i = 0; i < sums.sum.size(); ++i) {
    matrix.entries.push_back(core::mean_and_error(core::from_fixed_point(sums.sum[i]),
                                                  core::from_fixed_point(sums.sum_of_squares[i]),
                                                  static_cast<double>(paths)));
  }
  return matrix;
}

// With S = 1 / pi^2 every path that meets a fibre leaves in the end with weight 1, so under light
// from everywhere a[0, j1] is the harmonic j1 of the indicator of "something is hit".
TEST(TransportTransfer, Furnace_ShowsWhatIsHit) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  const Scene scene(tile);
  TransferSettings settings;
  settings.sh_order = 3;
  settings.seed = 4;
  settings.lights_below = true;
  constexpr std::uint64_t kPaths = 20000;
  const Matrix matrix = estimate(scene, shading::FibreBcsdf::furnace(), settings, kPaths);

  // The same integral by plain rays, independent numbers.
  std::vector<double> sum(matrix.coefficients);
  std::vector<double> squares(matrix.coefficients);
  constexpr int kRays = 200000;
  for (std::uint32_t i = 0; i < kRays; ++i) {
    core::Random random(77, i);
    const std::uint32_t k = random.below(tile.segment_count());
    const glm::vec3 direction = test::random_direction(random);
    const auto [origin, own] = bake_point(scene, k);
    if (scene.closest(origin, direction, 1e30f, own)) {
      const shading::ShVector y = shading::sh_evaluate(direction);
      for (std::size_t j = 0; j < sum.size(); ++j) {
        // sqrt(4 pi) Y_0 = 1 for the light's harmonic, 4 pi for the density of directions.
        const double value = 4 * kPi * y.c[j] / std::sqrt(4 * kPi);
        sum[j] += value;
        squares[j] += value * value;
      }
    }
  }
  const double limit = 3.6;  // 16 coefficients at 0.01 after Sidak: 3.42
  for (std::size_t j = 0; j < sum.size(); ++j) {
    const auto expected = core::mean_and_error(sum[j], squares[j], kRays);
    const auto& found = matrix.at(1, j, 0);
    EXPECT_LT(std::abs(found.mean - expected.mean),
              limit * std::hypot(found.standard_error, expected.standard_error))
        << "j1 = " << j;
    EXPECT_GT(found.standard_error, 0);
  }
  // All colours alike.
  EXPECT_EQ(matrix.at(0, 2, 1).mean, matrix.at(2, 2, 1).mean);
}

TEST(TransportTransfer, NothingElseToHit_GivesZero) {
  fabric::Tile tile = test::empty_tile(1000, 1000);
  test::add_strand(tile, {{500, 500, 0}, {500, 500.1f, 0}, {500, 500.2f, 0.05f}}, 0.01f, 0, 0);
  test::finish(tile);
  const Scene scene(tile);
  for (const Estimator estimator : {Estimator::kExit, Estimator::kLight}) {
    TransferSettings settings;
    settings.sh_order = 2;
    settings.estimator = estimator;
    const Matrix matrix = estimate(scene, shading::FibreBcsdf(wide_material()), settings, 2048);
    for (const auto& entry : matrix.entries) {
      EXPECT_EQ(entry.mean, 0);
    }
  }
}

TEST(TransportTransfer, BlackFibres_GiveNearlyNothing) {
  // Schlick's term keeps a little reflection at grazing even where C_R is zero.
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  const Scene scene(tile);
  shading::FibreMaterial black = wide_material();
  black.c_r = {0, 0, 0};
  black.c_tt = {0, 0, 0};
  TransferSettings settings;
  settings.sh_order = 0;
  const double dark = estimate(scene, shading::FibreBcsdf(black), settings, 20000).at(0, 0, 0).mean;
  const double bright =
      estimate(scene, shading::FibreBcsdf(wide_material()), settings, 20000).at(2, 0, 0).mean;
  EXPECT_GE(dark, 0);
  EXPECT_LT(dark, 0.1 * bright);
}

// Mean square of the differences in units of their standard errors, over all entries. Neighbouring
// entries are correlated, so the number of independent ones is not known: the spread of this mean
// is measured from runs of the same estimator, not assumed.
double chi_square_per_entry(const Matrix& a, const Matrix& b) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.entries.size(); ++i) {
    const double error = std::hypot(a.entries[i].standard_error, b.entries[i].standard_error);
    if (error > 0) {
      sum += std::pow((a.entries[i].mean - b.entries[i].mean) / error, 2);
      ++count;
    }
  }
  EXPECT_GT(count, a.entries.size() / 2);
  return sum / static_cast<double>(count);
}

struct MeanAndVariance {
  double mean;
  double variance;
};
MeanAndVariance mean_and_variance(const std::vector<double>& values) {
  const auto count = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double squares = 0;
  for (const double value : values) {
    squares += (value - mean) * (value - mean);
  }
  return {mean, squares / (count - 1)};
}

TEST(TransportTransfer, ExitAndLightEstimators_Agree) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  const Scene scene(tile);
  const shading::FibreBcsdf bcsdf(wide_material());
  TransferSettings settings;
  settings.sh_order = 3;
  settings.seed = 8;
  const Matrix exits = estimate(scene, bcsdf, settings, 60000);
  settings.estimator = Estimator::kLight;
  settings.seed = 9;
  const Matrix lights = estimate(scene, bcsdf, settings, 120000);
  const double limit = 4.29;  // 768 entries, two-sided, 0.01
  for (std::size_t i = 0; i < exits.entries.size(); ++i) {
    const double error =
        std::hypot(exits.entries[i].standard_error, lights.entries[i].standard_error);
    EXPECT_LE(std::abs(exits.entries[i].mean - lights.entries[i].mean), limit * error) << i;
  }
  // And they are not both nothing.
  EXPECT_GT(exits.at(2, 0, 0).mean, 20 * exits.at(2, 0, 0).standard_error);
  // The exit estimator's errors are far smaller for half the paths.
  EXPECT_LT(exits.at(1, 0, 0).standard_error, 0.8 * lights.at(1, 0, 0).standard_error);
}

// All entries together: pairs of runs of different estimators differ no more than pairs of runs of
// the paper's, whose paths are independent, so that they differ by what their errors say.
TEST(TransportTransfer, ExitAndLightEstimators_DifferNoMoreThanTwoRuns) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  const Scene scene(tile);
  const shading::FibreBcsdf bcsdf(wide_material());
  TransferSettings settings;
  settings.sh_order = 3;
  const auto run = [&](Estimator estimator, std::uint64_t seed) {
    settings.estimator = estimator;
    settings.seed = seed;
    return estimate(scene, bcsdf, settings, 16384);
  };
  constexpr int kPairs = 6;
  std::vector<double> mixed;
  std::vector<double> alike;
  for (std::uint64_t pair = 0; pair < kPairs; ++pair) {
    const Matrix lights = run(Estimator::kLight, 3 * pair);
    mixed.push_back(chi_square_per_entry(lights, run(Estimator::kExit, 3 * pair + 1)));
    alike.push_back(chi_square_per_entry(lights, run(Estimator::kLight, 3 * pair + 2)));
  }
  // Student's t with 10 degrees of freedom, one-sided, 0.01.
  const auto [mixed_mean, mixed_variance] = mean_and_variance(mixed);
  const auto [alike_mean, alike_variance] = mean_and_variance(alike);
  EXPECT_LT(mixed_mean - alike_mean, 2.764 * std::sqrt((mixed_variance + alike_variance) / kPairs));
}

// What plain paths, which end by roulette alone and take independent numbers, estimate.
Matrix plain_exits(const Scene& scene, const shading::FibreBcsdf& bcsdf, std::uint32_t order,
                   std::uint64_t paths) {
  const std::vector<shading::FibreBcsdf> materials{bcsdf};
  Matrix matrix;
  matrix.coefficients = (order + 1) * (order + 1);
  const std::size_t colour = matrix.coefficients * matrix.coefficients;
  std::vector<double> sum(3 * colour);
  std::vector<double> squares(3 * colour);
  for (std::uint64_t i = 0; i < paths; ++i) {
    core::Random random(31, 2, i);
    const std::uint32_t segment = random.below(scene.tile().segment_count());
    const glm::vec3 arrival = test::random_direction(random);
    Path path(scene, materials, segment, arrival);
    bool alive = true;
    while (alive && path.advance()) {
      alive = path.scatter(random);
    }
    if (!alive || path.vertices() == 0 || !(path.direction().z > 0)) {
      continue;
    }
    const shading::ShVector row = shading::sh_evaluate(arrival);
    const shading::ShVector light = shading::sh_evaluate(path.direction());
    for (std::size_t k = 0; k < sum.size(); ++k) {
      const double value =
          4 * kPi * static_cast<double>(path.throughput()[static_cast<int>(k / colour)]) *
          static_cast<double>(row.c[k / matrix.coefficients % matrix.coefficients] *
                              light.c[k % matrix.coefficients]);
      sum[k] += value;
      squares[k] += value * value;
    }
  }
  for (std::size_t k = 0; k < sum.size(); ++k) {
    matrix.entries.push_back(core::mean_and_error(sum[k], squares[k], static_cast<double>(paths)));
  }
  return matrix;
}

// White fibres of wide lobes, among which paths grow heavy and split: cotton, nearly.
TEST(TransportTransfer, SplitPaths_EstimateWhatPlainOnesDo) {
  const fabric::Tile tile = test::crossed_layers(6, 8, 0.03f, 4);
  const Scene scene(tile);
  shading::FibreMaterial white;
  white.c_r = {0.3f, 0.6f, 0.1f};
  white.c_tt = {0.999f, 0.9f, 0.999f};
  white.beta_r = 0.04f;
  white.beta_tt = 0.47f;
  white.gamma_tt = 0.67f;
  const shading::FibreBcsdf bcsdf(white);
  TransferSettings settings;
  settings.sh_order = 2;
  settings.seed = 19;
  const Matrix split = estimate(scene, bcsdf, settings, 40000);
  const Matrix plain = plain_exits(scene, bcsdf, settings.sh_order, 80000);
  for (std::size_t i = 0; i < split.entries.size(); ++i) {
    const double error =
        std::hypot(split.entries[i].standard_error, plain.entries[i].standard_error);
    // 243 entries, two-sided, 0.01.
    EXPECT_LE(std::abs(split.entries[i].mean - plain.entries[i].mean), 4.1 * error) << i;
  }
  // A path says more than a plain one: of as many, half would have 1.41 times the error.
  EXPECT_LT(split.at(0, 0, 0).standard_error, 1.3 * plain.at(0, 0, 0).standard_error);
}

// The spread of a[0, 0] over seeds, in units of the error that each run states.
double spread_over_stated_error(Estimator estimator) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 2);
  const Scene scene(tile);
  const shading::FibreBcsdf bcsdf(wide_material());
  TransferSettings settings;
  settings.sh_order = 1;
  settings.estimator = estimator;
  constexpr int kRuns = 60;
  double sum = 0;
  double squares = 0;
  double stated = 0;
  for (int run = 0; run < kRuns; ++run) {
    settings.seed = static_cast<std::uint64_t>(run);
    const Matrix matrix = estimate(scene, bcsdf, settings, 1024);
    sum += matrix.at(1, 0, 0).mean;
    squares += matrix.at(1, 0, 0).mean * matrix.at(1, 0, 0).mean;
    stated += matrix.at(1, 0, 0).standard_error / kRuns;
  }
  return std::sqrt((squares - sum * sum / kRuns) / (kRuns - 1)) / stated;
}

TEST(TransportTransfer, StandardErrors_AreThoseOfRepeatedRuns) {
  // chi of 59 degrees of freedom, 99 % two-sided: 0.76 to 1.24.
  const double spread = spread_over_stated_error(Estimator::kLight);
  EXPECT_GT(spread, 0.76);
  EXPECT_LT(spread, 1.24);
}

TEST(TransportTransfer, PointsSpreadEvenly_KeepWithinTheStandardErrors) {
  const double spread = spread_over_stated_error(Estimator::kExit);
  EXPECT_GT(spread, 0.2);
  EXPECT_LT(spread, 0.8);  // they gain something, too
}

TEST(TransportTransfer, AnySplitAtWholeChunks_GivesTheSameBytes) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  const Scene scene(tile);
  const CellSegments segments = all_segments(tile);
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf(wide_material())};
  for (const Estimator estimator : {Estimator::kExit, Estimator::kLight}) {
    TransferSettings settings;
    settings.estimator = estimator;
    settings.seed = 12;
    const TransferSums whole = transfer_sums(scene, materials, {3, &segments, 0, 1124}, settings);
    TransferSums parts{0, std::vector<std::int64_t>(whole.sum.size()),
                       std::vector<std::int64_t>(whole.sum.size()),
                       std::vector<std::int64_t>(whole.order_numbers.size()),
                       std::vector<std::int64_t>(whole.order_shapes.size())};
    for (const auto& [first, count] : {std::pair{0, 256}, {256, 512}, {768, 356}}) {
      const TransferSums part = transfer_sums(
          scene, materials,
          {3, &segments, static_cast<std::uint64_t>(first), static_cast<std::uint64_t>(count)},
          settings);
      add_sums(part, parts);
    }
    EXPECT_EQ(parts.paths, whole.paths);
    EXPECT_EQ(parts.sum, whole.sum);
    EXPECT_EQ(parts.sum_of_squares, whole.sum_of_squares);
    EXPECT_EQ(parts.order_numbers, whole.order_numbers);
    EXPECT_EQ(parts.order_shapes, whole.order_shapes);
    // Another cell, or another seed, has other paths.
    EXPECT_NE(transfer_sums(scene, materials, {4, &segments, 0, 1124}, settings).sum, whole.sum);
  }
}

TEST(TransportTransfer, PathsLongerThanAllowed_CountForNothing) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  const Scene scene(tile);
  const shading::FibreBcsdf bcsdf(wide_material());
  TransferSettings settings;
  settings.sh_order = 0;
  settings.max_path_length = 1;
  const auto once_exit = estimate(scene, bcsdf, settings, 40000).at(2, 0, 0);
  settings.estimator = Estimator::kLight;
  const auto once_light = estimate(scene, bcsdf, settings, 40000).at(2, 0, 0);
  settings.max_path_length = 1000;
  const auto all = estimate(scene, bcsdf, settings, 40000).at(2, 0, 0);
  EXPECT_LT(std::abs(once_exit.mean - once_light.mean),
            2.8 * std::hypot(once_exit.standard_error, once_light.standard_error));
  EXPECT_GT(all.mean,
            once_exit.mean + 5 * std::hypot(all.standard_error, once_exit.standard_error));
}

TEST(TransportTransfer, Cancellation_EndsTheWork) {
  const fabric::Tile tile = test::crossed_layers(2, 4, 0.02f, 2);
  const Scene scene(tile);
  const CellSegments segments = all_segments(tile);
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf(wide_material())};
  int calls = 0;
  const auto cancel = [&] {
    if (++calls == 3) {
      throw core::Error(core::Code::kCancelled, "stop");
    }
  };
  EXPECT_THROW(
      static_cast<void>(transfer_sums(scene, materials, {0, &segments, 0, 1u << 30}, {}, cancel)),
      core::Error);
  EXPECT_EQ(calls, 3);
}

}  // namespace
}  // namespace weft::transport
