#include <cstdint>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/random.h"
#include "render/flat_cloth.h"
#include "render/gpu/device.h"
#include "render/gpu/geometry.h"
#include "tests/kernels/kernels.h"
#include "tests/kernels/solid_queries.h"
#include "tests/render_cloths.h"

// The shared text of render/kernels/solid.h on the device against the same text in C++.

namespace weft::render::gpu {
namespace {

using shading::SolidAnswer;
using shading::SolidQuery;
using testing::IsEmpty;

using Cloths = std::vector<std::unique_ptr<Cloth>>;

Cloths flat_and_folded() {
  const auto cloth = test::fabric_of(test::crossed_layers(4, 6, 0.05F, 2));
  Cloths cloths;
  FlatPlacement swatch;
  swatch.size_mm = {6, 4};
  swatch.turn = 0.7;
  cloths.push_back(make_flat_cloth(cloth, swatch));
  cloths.push_back(test::shell_of(cloth, test::sheet(30, 3, [](glm::dvec2 p) {
                                    return test::in_folds(p) + glm::dvec3(0, 0, 4);
                                  })));
  return cloths;
}

std::vector<SolidQuery> queries_about(const Cloths& cloths, const GeometryArrays& arrays,
                                      std::size_t count) {
  std::vector<SolidQuery> queries;
  for (std::uint32_t i = 0; queries.size() < count; ++i) {
    core::Random random(11, i);
    const auto spread = [&random] { return static_cast<float>(4 * random.uniform_double() - 2); };
    SolidQuery query{};
    query.cloth = static_cast<int>(i % cloths.size());
    const Cloth::Bounds bounds = cloths[i % cloths.size()]->bounds();
    const glm::vec3 middle(0.5 * (bounds.low_mm + bounds.high_mm));
    const glm::vec3 half(0.5 * (bounds.high_mm - bounds.low_mm));
    query.origin_mm = middle + half * glm::vec3(spread(), spread(), spread());
    query.direction = test::random_direction(random);
    query.t_max_mm = i % 3 == 0 ? 2.0F : 1e30F;
    const bool is_shell = arrays.cloths[i % cloths.size()].kind == shading::kClothShell;
    query.place =
        is_shell
            ? static_cast<int>(random.below(static_cast<std::uint32_t>(arrays.tetrahedra.size())))
            : -1;
    if (is_shell) {
      // Near the triangle that the place belongs to, so that walks are short and long.
      query.flat_mm =
          glm::vec3(arrays.shell_triangles[static_cast<std::size_t>(query.place / 3)].flat_0_mm, 0);
    }
    query.offset_mm = {0.5F * spread(), 0.5F * spread()};
    queries.push_back(query);
  }
  return queries;
}

std::vector<SolidAnswer> on_device(Device& device, const GeometryArrays& arrays,
                                   const std::vector<SolidQuery>& queries) {
  const Buffer cloths = device.upload(arrays.cloths, "cloths");
  const Buffer tetrahedra = device.upload(arrays.tetrahedra, "tetrahedra");
  const Buffer triangles = device.upload(arrays.shell_triangles, "triangles");
  const Buffer nodes = device.upload(arrays.nodes, "nodes");
  const Buffer faces = device.upload(arrays.outer_faces, "faces");
  const Buffer in = device.upload(queries, "queries");
  const Buffer out = device.allocate(queries.size() * sizeof(SolidAnswer), "answers");
  struct {
    std::uint32_t count;
    std::int32_t cloths;
  } push{static_cast<std::uint32_t>(queries.size()),
         static_cast<std::int32_t>(arrays.cloths.size())};
  const Kernel kernel = device.make_kernel(test_kernels::solid_parity, 7, sizeof(push));
  const Dispatch dispatch{.kernel = &kernel,
                          .buffers = {&cloths, &tetrahedra, &triangles, &nodes, &faces, &in, &out},
                          .push = push_constants(push),
                          .groups_x = (push.count + 63) / 64};
  (void)device.run({&dispatch, 1});
  return device.download<SolidAnswer>(out, queries.size());
}

TEST(SolidParity, OfDeviceAndHost) {
  constexpr std::size_t kQueries = 6000;
  const Cloths cloths = flat_and_folded();
  const GeometryArrays arrays = pack_geometry(cloths);
  const std::vector<SolidQuery> queries = queries_about(cloths, arrays, kQueries);
  const auto device = Device::open("", {.validation = Validation::kOn});
  const std::vector<SolidAnswer> answers = on_device(*device, arrays, queries);
  int blocked = 0;
  int different = 0;
  int topped = 0;
  for (std::size_t i = 0; i < kQueries; ++i) {
    const SolidAnswer host =
        shading::solid_answer(&arrays, static_cast<int>(cloths.size()), queries[i]);
    blocked += host.cloth_blocks;
    topped += host.top_exists;
    const bool same = host.cloth_blocks == answers[i].cloth_blocks &&
                      host.any_blocks == answers[i].any_blocks &&
                      host.top_exists == answers[i].top_exists;
    different += same ? 0 : 1;
    if (same && host.top_exists != 0) {
      EXPECT_LT(glm::distance(host.top_mm, answers[i].top_mm), 1e-5F) << i;
    }
    EXPECT_EQ(host.rotation, answers[i].rotation) << i;
  }
  EXPECT_LE(different, 3);  // at edges, by rounding
  EXPECT_GT(blocked, 600);
  EXPECT_LT(blocked, 5400);
  EXPECT_GT(topped, 600);
  EXPECT_LT(topped, 5900);
  EXPECT_THAT(device->complaints(), IsEmpty());
}

}  // namespace
}  // namespace weft::render::gpu
