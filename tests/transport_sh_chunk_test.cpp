#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/moments.h"
#include "core/random.h"
#include "shading/spherical_harmonics.h"
#include "tests/transport_tiles.h"
#include "transport/sh_chunk.h"

namespace weft::transport {
namespace {

struct FoundPath {
  glm::vec3 arrival;
  std::vector<LightSample> lights;
};

// Paths of no, one or several lights.
std::vector<FoundPath> some_paths(std::size_t count, std::uint64_t seed) {
  std::vector<FoundPath> paths;
  for (std::size_t i = 0; i < count; ++i) {
    core::Random random(seed, 0, i);
    FoundPath path{test::random_direction(random), {}};
    for (std::uint32_t n = random.below(4); n > 0; --n) {
      LightSample light;
      light.direction = test::random_direction(random);
      const float red = random.uniform();
      light.weight = {red, 2 * random.uniform(), 0.1f};
      path.lights.push_back(light);
    }
    paths.push_back(path);
  }
  return paths;
}

// Sums and sums of squares [3, rows, columns] by their definition, in double.
struct Sums {
  std::vector<double> sum;
  std::vector<double> squares;
};
Sums plain_sums(const std::vector<FoundPath>& paths, std::size_t coefficients) {
  Sums sums{std::vector<double>(3 * coefficients * coefficients),
            std::vector<double>(3 * coefficients * coefficients)};
  for (const FoundPath& path : paths) {
    const shading::ShVector row = shading::sh_evaluate(path.arrival);
    for (std::size_t i = 0; i < sums.sum.size(); ++i) {
      double light = 0;
      for (const LightSample& found : path.lights) {
        const auto colour = static_cast<int>(i / (coefficients * coefficients));
        const shading::ShVector y = shading::sh_evaluate(found.direction);
        light +=
            static_cast<double>(found.weight[colour]) * static_cast<double>(y.c[i % coefficients]);
      }
      const double value = light * static_cast<double>(row.c[i / coefficients % coefficients]);
      sums.sum[i] += value;
      sums.squares[i] += value * value;
    }
  }
  return sums;
}

void add(const std::vector<FoundPath>& paths, ShChunk& chunk) {
  for (const FoundPath& path : paths) {
    chunk.add(path.arrival, path.lights);
  }
}

TEST(ShChunk, SumsWhatItsDefinitionSays) {
  for (const std::uint32_t order : {0U, 1U, 2U, 3U, 4U, 5U}) {
    for (const std::size_t count : {std::size_t{1}, ShChunk::kBlockPaths, std::size_t{256}}) {
      ShChunk chunk(order);
      const auto paths = some_paths(count, 3 + order);
      add(paths, chunk);
      std::vector<std::int64_t> sum(chunk.size());
      std::vector<std::int64_t> squares(chunk.size());
      chunk.flush(sum, squares);
      const std::size_t coefficients = std::size_t{order + 1} * (order + 1);
      const Sums expected = plain_sums(paths, coefficients);
      ASSERT_EQ(sum.size(), expected.sum.size());
      for (std::size_t i = 0; i < sum.size(); ++i) {
        const double tolerance = 3e-6 * (std::sqrt(expected.squares[i]) + 1e-3) * 16;
        ASSERT_NEAR(core::from_fixed_point(sum[i]), expected.sum[i], tolerance) << i;
        ASSERT_NEAR(core::from_fixed_point(squares[i]), expected.squares[i],
                    1e-5 * expected.squares[i] + 1e-6)
            << i;
      }
    }
  }
}

TEST(ShChunk, FlushAddsAndStartsAnew) {
  ShChunk chunk(2);
  std::vector<std::int64_t> sum(chunk.size());
  std::vector<std::int64_t> squares(chunk.size());
  const auto paths = some_paths(100, 4);
  add(paths, chunk);
  chunk.flush(sum, squares);
  const std::vector<std::int64_t> once = sum;
  chunk.flush(sum, squares);
  EXPECT_EQ(sum, once);
  add(paths, chunk);
  chunk.flush(sum, squares);
  for (std::size_t i = 0; i < sum.size(); ++i) {
    EXPECT_EQ(sum[i], 2 * once[i]);
  }
}

TEST(ShChunk, PathsWithoutLightChangeNothing) {
  ShChunk with(3);
  ShChunk without(3);
  for (const FoundPath& path : some_paths(256, 5)) {
    with.add(path.arrival, path.lights);
    if (!path.lights.empty()) {
      without.add(path.arrival, path.lights);
    }
  }
  std::vector<std::int64_t> a(with.size());
  std::vector<std::int64_t> b(with.size());
  std::vector<std::int64_t> a_squares(with.size());
  std::vector<std::int64_t> b_squares(with.size());
  with.flush(a, a_squares);
  without.flush(b, b_squares);
  EXPECT_EQ(a, b);
  EXPECT_EQ(a_squares, b_squares);
}

TEST(ShChunk, SumsSaturateInsteadOfOverflowing) {
  ShChunk chunk(0);
  for (int i = 0; i < 256; ++i) {
    const LightSample light{{1e6f, -1e6f, 1}, {0, 0, 1}};
    chunk.add({0, 0, 1}, {&light, 1});
  }
  std::vector<std::int64_t> sum(3);
  std::vector<std::int64_t> squares(3);
  chunk.flush(sum, squares);
  EXPECT_EQ(core::from_fixed_point(squares[0]), ShChunk::kLargestSum);
  EXPECT_EQ(core::from_fixed_point(squares[1]), ShChunk::kLargestSum);
  EXPECT_NEAR(core::from_fixed_point(sum[1]), -256e6 / (4 * 3.14159265), 100);
  EXPECT_NEAR(core::from_fixed_point(sum[2]), 256 / (4 * 3.14159265), 1e-3);
}

}  // namespace
}  // namespace weft::transport
