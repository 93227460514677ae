#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/half.h"
#include "core/random.h"
#include "render/gpu/device.h"
#include "render/gpu/fabric_tables.h"
#include "render/precomputed_fabric.h"
#include "tests/kernels/kernels.h"
#include "tests/render_random_fabric.h"
#include "tests/transport_tiles.h"

// The shared text that reads a fabric's tables, on the device against the same text in C++.

namespace weft::shading {

inline const render::PrecomputedFabric* asked_fabric = nullptr;  // of the question below

[[nodiscard]] inline FibreLobes lobes_of_segment(int segment) {
  return asked_fabric->bcsdf_of_segment(static_cast<std::uint32_t>(segment)).lobes();
}

}  // namespace weft::shading

#include "tests/kernels/table_queries.h"

namespace weft::render::gpu {
namespace {

using shading::TableAnswer;
using shading::TableQuery;
using testing::IsEmpty;

constexpr std::size_t kQueries = 4000;

void round_to_halves(std::vector<float>& values) {
  for (float& value : values) {
    value = core::float_from_half(core::half_from_float(value));
  }
}

// What a device stores as halves is in halves here already, so that only arithmetic differs.
std::shared_ptr<const Fabric> rounded_fabric() {
  storage::FabricDatabase db = random_database({.seed = 5});
  round_to_halves(db.ssdf_mean);
  round_to_halves(db.ssdf_basis);
  round_to_halves(db.transfer);
  return Fabric::from_database(std::move(db), Fabric::Wanted::kFibresAndTransfer);
}

std::vector<TableQuery> random_queries(const storage::FabricDatabase& db) {
  std::vector<TableQuery> queries;
  for (std::uint32_t i = 0; i < kQueries; ++i) {
    core::Random random(21, i);
    const auto up = [&random] {
      glm::vec3 w = test::random_direction(random);
      w.z = random.below(8) == 0 ? w.z : std::fabs(w.z);
      return w;
    };
    TableQuery query{};
    query.segment =
        static_cast<int>(random.below(static_cast<std::uint32_t>(db.cell_of_segment.size())));
    query.cell = static_cast<int>(random.below(static_cast<std::uint32_t>(db.cell_paths.size())));
    query.material = static_cast<int>(random.below(2));
    query.tangent = test::random_direction(random);
    query.to_eye = up();
    query.light = i % 50 == 0 ? glm::vec3(0, 0, 1) : up();
    query.sharpness = std::pow(10.0F, -2 + 5 * random.uniform());
    query.point_mm = 3.0F * test::random_direction(random);
    query.uniforms = {random.uniform(), random.uniform()};
    query.drawn.kind = static_cast<int>(i % 5);
    query.drawn.place = query.drawn.kind < 2 ? up() : 40.0F * up();
    query.drawn.edge_a = test::random_direction(random);
    query.drawn.edge_b = 2.0F * test::random_direction(random);
    query.drawn.sharpness = 2;
    query.drawn.colour = {1, 2, 3};
    queries.push_back(query);
  }
  return queries;
}

std::vector<TableAnswer> on_device(Device& device, const Fabric& fabric,
                                   const std::vector<TableQuery>& queries) {
  const DeviceFabricTables tables(device, pack_fabric(fabric));
  const Buffer in = device.upload(queries, "queries");
  const Buffer out = device.allocate(queries.size() * sizeof(TableAnswer), "answers");
  std::vector<const Buffer*> buffers = tables.buffers();
  buffers.insert(buffers.end(), {&tables.pages().front().transfer, &in, &out});
  const auto count = static_cast<std::uint32_t>(queries.size());
  const Kernel kernel =
      device.make_kernel(test_kernels::table_parity, static_cast<std::uint32_t>(buffers.size()), 4);
  const Dispatch dispatch{.kernel = &kernel,
                          .buffers = buffers,
                          .push = push_constants(count),
                          .groups_x = (count + 63) / 64};
  (void)device.run({&dispatch, 1});
  return device.download<TableAnswer>(out, queries.size());
}

constexpr std::size_t kNumbers = sizeof(TableAnswer) / 4;
using Numbers = std::array<float, kNumbers>;

Numbers numbers_of(const TableAnswer& answer) {
  Numbers numbers;
  std::memcpy(numbers.data(), &answer, sizeof(answer));
  numbers[1] = static_cast<float>(answer.sees);
  return numbers;
}

TEST(TableParity, OfDeviceAndHost) {
  constexpr double kTermSize = 1e-2;
  const auto fabric = rounded_fabric();
  const PrecomputedFabric& precomputed = *fabric->precomputed();
  const std::vector<TableQuery> queries = random_queries(precomputed.database());
  const auto device = Device::open("", {.validation = Validation::kOn});
  const std::vector<TableAnswer> answers = on_device(*device, *fabric, queries);
  shading::asked_fabric = &precomputed;
  std::array<std::vector<double>, kNumbers> errors;
  std::array<bool, kNumbers> varies{};
  Numbers first{};
  for (std::size_t i = 0; i < kQueries; ++i) {
    const Numbers host = numbers_of(shading::table_answer(precomputed.tables(), queries[i]));
    const Numbers of_device = numbers_of(answers[i]);
    first = i == 0 ? host : first;
    for (std::size_t k = 0; k < kNumbers; ++k) {
      ASSERT_TRUE(std::isfinite(of_device[k]) && std::isfinite(host[k])) << k << " of " << i;
      const auto a = static_cast<double>(of_device[k]);
      const auto b = static_cast<double>(host[k]);
      errors[k].push_back(std::abs(a - b) / (std::abs(b) + kTermSize));
      varies[k] = varies[k] || host[k] < first[k] || host[k] > first[k];
    }
  }
  // Devices may compute log(x) near x = 1 to 5e-7 only, which moves a drawn direction near its
  // axis.
  constexpr std::size_t kGaussianDraw = offsetof(TableAnswer, gaussian_draw) / 4;
  for (std::size_t k = 0; k < kNumbers; ++k) {
    const bool is_draw = k >= kGaussianDraw && k < kGaussianDraw + 3;
    const double usual = is_draw ? 1e-4 : 1e-5;
    const double outlier = is_draw ? 2e-3 : 2e-4;
    std::vector<double>& sorted = errors[k];
    std::sort(sorted.begin(), sorted.end());
    EXPECT_TRUE(varies[k]) << "number " << k;
    EXPECT_LE(sorted[sorted.size() * 99 / 100], usual) << "number " << k;
    EXPECT_LE(sorted.end() - std::upper_bound(sorted.begin(), sorted.end(), outlier), 3)
        << "number " << k;
  }
  EXPECT_THAT(device->complaints(), IsEmpty());
}

}  // namespace
}  // namespace weft::render::gpu
