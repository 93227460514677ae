#include <cmath>
#include <numeric>
#include <set>
#include <thread>

#include <gtest/gtest.h>
#include <xmmintrin.h>

#include "core/error.h"
#include "core/half.h"
#include "core/stopping.h"
#include "fabric/description.h"
#include "proto/arrays.h"
#include "tests/transport_tiles.h"
#include "worker/baker.h"

namespace weft::worker {
namespace {

constexpr std::uint32_t kResolution = 32;
constexpr std::uint64_t kVisibilityShards = 6;

bool never() { return false; }

std::string bake(const BakerContext& context, std::uint64_t shard,
                 const std::string& shard_input = {}) {
  return make_baker(context)->bake(shard, shard_input, never);
}

fabric::Tile tile_of_test() {
  fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 6);
  tile.blocks = {2, 1};
  return tile;
}

BakerContext grid_context() {
  BakerContext context;
  context.spec.mutable_grid()->set_cell_length_mfp(2);
  context.spec.mutable_grid()->set_rays(4096);
  context.spec.mutable_grid()->set_seed(5);
  context.spec.mutable_grid()->set_seen_rays_per_segment(16);
  context.shard_count = 1;
  context.inputs = {fabric::encode_tile(tile_of_test())};
  return context;
}

BakerContext visibility_context() {
  BakerContext context;
  context.spec.mutable_visibility()->set_resolution(kResolution);
  context.shard_count = kVisibilityShards;
  context.inputs = {fabric::encode_tile(tile_of_test())};
  return context;
}

BakerContext basis_context() {
  BakerContext context;
  context.spec.mutable_basis()->set_resolution(kResolution);
  context.spec.mutable_basis()->set_components(24);
  context.spec.mutable_basis()->set_seed(2);
  context.shard_count = 1;
  const auto baker = make_baker(visibility_context());
  for (std::uint64_t shard = 0; shard < kVisibilityShards - 1; ++shard) {
    context.inputs.push_back(baker->bake(shard, {}, never));
  }
  return context;
}

BakerContext transfer_context(v1::TransferEstimator estimator = v1::TRANSFER_ESTIMATOR_EXIT) {
  BakerContext context;
  v1::TransferSpec& spec = *context.spec.mutable_transfer();
  spec.set_sh_order(2);
  spec.set_paths_per_cell(700);
  spec.set_paths_per_shard(256);
  spec.set_estimator(estimator);
  spec.set_seed(3);
  spec.set_max_path_length(1000);
  v1::Material& material = *spec.add_materials();
  for (v1::Rgb* rgb : {material.mutable_c_r(), material.mutable_c_tt()}) {
    rgb->set_r(0.2);
    rgb->set_g(0.4);
    rgb->set_b(0.6);
  }
  material.set_beta_r_deg(8);
  material.set_beta_tt_deg(10);
  material.set_gamma_tt_deg(25);
  const std::string grid = bake(grid_context(), 0);
  std::vector<std::uint64_t> shape;
  static_cast<void>(
      v1::array_of<std::uint32_t>(v1::parse_arrays(grid), "cell_coordinates", &shape));
  context.shard_count = shape[0] * 3;
  context.inputs = {grid_context().inputs[0], grid};
  return context;
}

BakerContext shadow_context(std::uint32_t paths_per_shard) {
  BakerContext context = transfer_context();
  const v1::Material material = context.spec.transfer().materials(0);
  v1::ShadowSpec& spec = *context.spec.mutable_shadow();
  spec.set_paths(1000);
  spec.set_paths_per_shard(paths_per_shard);
  *spec.add_materials() = material;
  spec.set_seed(6);
  spec.set_max_path_length(100);
  spec.set_bins(32);
  spec.set_bin_mfp(0.125);
  context.shard_count = (1000 + paths_per_shard - 1) / paths_per_shard;
  return context;
}

std::vector<std::int64_t> shadow_sums(std::uint32_t paths_per_shard) {
  const BakerContext context = shadow_context(paths_per_shard);
  const auto baker = make_baker(context);
  std::vector<std::int64_t> sums(33, 0);
  std::uint64_t paths = 0;
  for (std::uint64_t shard = 0; shard < context.shard_count; ++shard) {
    const v1::Arrays arrays = v1::parse_arrays(baker->bake(shard, {}, never));
    const auto part = v1::array_of<std::int64_t>(arrays, "sum");
    paths += v1::array_of<std::uint64_t>(arrays, "paths")[0];
    EXPECT_EQ(part.size(), sums.size());
    for (std::size_t i = 0; i < sums.size(); ++i) {
      sums[i] += part[i];
    }
  }
  EXPECT_EQ(paths, 1000U);
  return sums;
}

TEST(ShadowBaker, ShardsOfAnySizeGiveTheSameSums) {
  const std::vector<std::int64_t> whole = shadow_sums(1000);
  EXPECT_GT(std::accumulate(whole.begin(), whole.end(), std::int64_t{0}), 0);
  EXPECT_EQ(shadow_sums(300), whole);
  EXPECT_EQ(shadow_sums(1), whole);
}

TEST(ShadowBaker, RefusesWhatMakesNoSense) {
  for (const auto& spoil : std::vector<void (*)(v1::ShadowSpec&)>{
           [](v1::ShadowSpec& spec) { spec.set_bins(0); },
           [](v1::ShadowSpec& spec) { spec.set_bin_mfp(-1); },
           [](v1::ShadowSpec& spec) { spec.set_paths(0); },
           [](v1::ShadowSpec& spec) { spec.set_paths_per_shard(0); },
           [](v1::ShadowSpec& spec) { spec.clear_materials(); },
           [](v1::ShadowSpec& spec) { spec.set_paths(1001); }}) {
    BakerContext context = shadow_context(1000);
    spoil(*context.spec.mutable_shadow());
    EXPECT_THROW(static_cast<void>(make_baker(context)), core::Error);
  }
}

TEST(WorkerBaker, Geometry_IsTheTileOfItsDescription) {
  BakerContext context;
  *context.spec.mutable_geometry()->mutable_description() =
      fabric::geometry_part(fabric::load_description(WEFT_SOURCE_DIR "/examples/tiny.textproto"));
  context.shard_count = 1;
  const std::string result = bake(context, 0);
  EXPECT_EQ(result, bake(context, 0));
  const fabric::Tile tile = fabric::decode_tile(result);
  EXPECT_GT(tile.segment_count(), 0u);
  EXPECT_EQ(tile.threads.size(), 8u);
  context.inputs = {"something"};
  EXPECT_THROW(static_cast<void>(make_baker(context)), core::Error);
}

TEST(WorkerBaker, Grid_HasWhatItsSpecPromises) {
  const v1::Arrays result = v1::parse_arrays(bake(grid_context(), 0));
  const auto path = v1::array_of<float>(result, "mean_free_path_mm");
  ASSERT_EQ(path.size(), 1u);
  EXPECT_GT(path[0], 0.01f);
  EXPECT_LT(path[0], 1.0f);
  const auto per_axis = v1::array_of<std::uint32_t>(result, "cells_per_axis");
  ASSERT_EQ(per_axis.size(), 3u);
  EXPECT_EQ(per_axis[0], 2 * std::max(1.0f, std::round(0.5f / (2 * path[0]))));
  const auto cells = v1::array_of<std::uint32_t>(result, "cell_of_segment");
  EXPECT_EQ(cells.size(), tile_of_test().segment_count());
  const auto seen = v1::array_of<std::uint32_t>(result, "seen");
  ASSERT_EQ(seen.size(), cells.size());
  EXPECT_LE(std::accumulate(seen.begin(), seen.end(), 0u), 16 * seen.size());
}

TEST(WorkerBaker, Visibility_IsAStratifiedSampleOfTheTile) {
  const std::uint32_t segments = tile_of_test().segment_count();
  const auto baker = make_baker(visibility_context());
  std::uint64_t total = 0;
  for (std::uint64_t shard = 0; shard < kVisibilityShards; ++shard) {
    std::vector<std::uint64_t> shape;
    const std::string result = baker->bake(shard, {}, never);
    const auto bits = v1::array_of<std::uint8_t>(v1::parse_arrays(result), "bits", &shape);
    ASSERT_EQ(shape.size(), 2u);
    EXPECT_EQ(shape[0], (segments - shard + kVisibilityShards - 1) / kVisibilityShards);
    EXPECT_EQ(shape[1], kResolution * kResolution / 8);
    total += shape[0];
    EXPECT_EQ(result, baker->bake(shard, {}, never));
  }
  EXPECT_EQ(total, segments);
}

TEST(WorkerBaker, Coefficients_GiveMostSignsBack) {
  const std::string basis = bake(basis_context(), 0);
  const auto variance = v1::array_of<float>(v1::parse_arrays(basis), "variance");
  ASSERT_EQ(variance.size(), 24u);
  for (std::size_t i = 1; i < variance.size(); ++i) {
    EXPECT_LE(variance[i], variance[i - 1] * 1.0001f);
  }
  BakerContext context;
  v1::CoefficientsSpec& spec = *context.spec.mutable_coefficients();
  spec.set_resolution(kResolution);
  spec.set_sg_count(16);
  spec.set_sg_sharpness(128);
  spec.set_rotation_seed(77);
  context.shard_count = kVisibilityShards;
  context.inputs = {basis};
  // The last shard is one that the basis did not read.
  const std::uint64_t shard = kVisibilityShards - 1;
  const std::string visibility = bake(visibility_context(), shard);
  const v1::Arrays result = v1::parse_arrays(bake(context, shard, visibility));
  std::vector<std::uint64_t> shape;
  const auto ssdf = v1::array_of<v1::Half>(result, "ssdf", &shape);
  ASSERT_EQ(shape, (std::vector<std::uint64_t>{shape[0], 24}));
  const std::uint64_t count = shape[0];
  const auto ssg = v1::array_of<v1::Half>(result, "ssg", &shape);
  EXPECT_EQ(shape, (std::vector<std::uint64_t>{count, 16}));
  const auto rotation = v1::array_of<std::uint32_t>(result, "rotation");
  ASSERT_EQ(rotation.size(), count);
  EXPECT_NE(rotation[0], rotation[1]);
  const auto open = v1::array_of<v1::Half>(result, "open_share");
  ASSERT_EQ(open.size(), count);
  const auto errors = v1::array_of<std::uint32_t>(result, "sign_errors");
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_GT(errors[1], 0u);
  EXPECT_LT(errors[0], errors[1] / 20);

  // The Gaussians hold the open solid angle of the upper hemisphere: no more than is open at all.
  for (std::uint64_t i = 0; i < count; ++i) {
    float sum = 0;
    for (std::size_t q = 0; q < 16; ++q) {
      sum += core::float_from_half(ssg[i * 16 + q].bits);
    }
    EXPECT_LE(sum, 12.567f * core::float_from_half(open[i].bits) + 0.01f);
  }
}

TEST(WorkerBaker, Transfer_CutsACellIntoBlocks) {
  const BakerContext context = transfer_context();
  const auto baker = make_baker(context);
  std::uint64_t paths = 0;
  for (std::uint64_t block = 0; block < 3; ++block) {
    const v1::Arrays result = v1::parse_arrays(baker->bake(3 + block, {}, never));
    paths += v1::array_of<std::uint64_t>(result, "paths").at(0);
    std::vector<std::uint64_t> shape;
    const auto sum = v1::array_of<std::int64_t>(result, "sum", &shape);
    EXPECT_EQ(shape, (std::vector<std::uint64_t>{3, 9, 9}));
    EXPECT_GT(sum[0], 0);
    // A brighter blue.
    EXPECT_GT(sum[2 * 81], sum[0]);
    EXPECT_GT(v1::array_of<std::int64_t>(result, "sum_of_squares").at(0), 0);
  }
  EXPECT_EQ(paths, 700u);
}

BakerContext target_context(double target) {
  BakerContext context = transfer_context();
  v1::TransferSpec& spec = *context.spec.mutable_transfer();
  spec.set_paths_per_cell(20'000);
  spec.set_paths_per_shard(20'000);
  spec.set_target_standard_error(target);
  context.shard_count /= 3;
  return context;
}

struct StoppedCell {
  std::uint64_t paths = 0;
  double error = 0;
};

StoppedCell stopped_cell(const std::string& result) {
  const v1::Arrays arrays = v1::parse_arrays(result);
  const std::uint64_t paths = v1::array_of<std::uint64_t>(arrays, "paths").at(0);
  return {paths, core::root_mean_square_error({v1::array_of<std::int64_t>(arrays, "sum"),
                                               v1::array_of<std::int64_t>(arrays, "sum_of_squares"),
                                               paths})};
}

TEST(WorkerBaker, TransferToAnError_UsesAsManyPathsAsTheCellNeeds) {
  constexpr double kTarget = 0.0026;
  const auto baker = make_baker(target_context(kTarget));
  std::set<std::uint64_t> counts;
  for (std::uint64_t cell = 0; cell < target_context(kTarget).shard_count; ++cell) {
    const std::string result = baker->bake(cell, {}, never);
    EXPECT_EQ(result, bake(target_context(kTarget), cell));
    const StoppedCell found = stopped_cell(result);
    EXPECT_LE(found.error, kTarget);
    EXPECT_EQ(found.paths % core::kStoppingBlockPaths, 0u);
    EXPECT_GE(found.paths, 1024u);
    EXPECT_LT(found.paths, 20'000u);
    counts.insert(found.paths);
  }
  EXPECT_GT(counts.size(), 1u);
  EXPECT_EQ(stopped_cell(bake(target_context(1e-6), 0)).paths, 20'000u);
  EXPECT_EQ(stopped_cell(bake(target_context(1), 0)).paths, 1024u);
}

TEST(WorkerBaker, ManyThreadsAndFloatModes_GiveTheSameBytes) {
  for (const BakerContext& context :
       {visibility_context(), transfer_context(), transfer_context(v1::TRANSFER_ESTIMATOR_LIGHT),
        target_context(0.005)}) {
    const auto baker = make_baker(context);
    std::vector<std::string> alone;
    for (std::uint64_t shard = 0; shard < 4; ++shard) {
      alone.push_back(baker->bake(shard, {}, never));
    }
    std::vector<std::string> together(4);
    std::vector<std::thread> threads;
    for (std::uint64_t shard = 0; shard < 4; ++shard) {
      threads.emplace_back([&, shard] {
        const unsigned flush = shard % 2 == 0 ? 0 : 0x8040;
        _mm_setcsr(_mm_getcsr() | flush);
        together[shard] = baker->bake(shard, {}, never);
      });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
    EXPECT_EQ(alone, together);
  }
}

TEST(WorkerBaker, EveryKind_StopsWhenTold) {
  BakerContext coefficients;
  coefficients.spec.mutable_coefficients()->set_resolution(kResolution);
  coefficients.spec.mutable_coefficients()->set_sg_count(4);
  coefficients.shard_count = kVisibilityShards;
  const BakerContext basis = basis_context();
  coefficients.inputs = {bake(basis, 0)};
  BakerContext transfer = transfer_context();
  for (const BakerContext& context :
       {grid_context(), visibility_context(), basis, coefficients, transfer}) {
    const auto baker = make_baker(context);
    const std::string& input = basis.inputs[0];
    try {
      static_cast<void>(baker->bake(0, input, [] { return true; }));
      FAIL() << context.spec.ShortDebugString();
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kCancelled);
    }
  }
}

void expect_refused(const BakerContext& context, core::Code code) {
  try {
    static_cast<void>(bake(context, 0));
    FAIL() << context.spec.ShortDebugString();
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
  }
}

TEST(WorkerBaker, NonsenseSpecs_AreRefused) {
  expect_refused({}, core::Code::kInvalidArgument);
  BakerContext context = grid_context();
  context.spec.mutable_grid()->set_rays(0);
  expect_refused(context, core::Code::kInvalidArgument);
  context = grid_context();
  context.spec.mutable_grid()->set_cell_length_mfp(std::nan(""));
  expect_refused(context, core::Code::kInvalidArgument);
  context = visibility_context();
  context.spec.mutable_visibility()->set_resolution(100);
  expect_refused(context, core::Code::kInvalidArgument);
  context = visibility_context();
  context.inputs.clear();
  expect_refused(context, core::Code::kInvalidArgument);
  context = transfer_context();
  context.spec.mutable_transfer()->clear_materials();
  expect_refused(context, core::Code::kInvalidArgument);
  context = transfer_context();
  context.spec.mutable_transfer()->mutable_materials(0)->set_beta_r_deg(-1);
  expect_refused(context, core::Code::kInvalidArgument);
  context = transfer_context();
  ++context.shard_count;
  expect_refused(context, core::Code::kInvalidArgument);
  for (const double target : {-0.1, std::nan("")}) {
    expect_refused(target_context(target), core::Code::kInvalidArgument);
  }
  context = transfer_context();
  context.spec.mutable_transfer()->set_target_standard_error(0.1);  // in blocks
  expect_refused(context, core::Code::kInvalidArgument);
  context = target_context(0.1);
  context.spec.mutable_transfer()->set_paths_per_cell((1 << 20) + 1);
  context.spec.mutable_transfer()->set_paths_per_shard((1 << 20) + 1);
  expect_refused(context, core::Code::kInvalidArgument);
  context = grid_context();
  context.shard_count = 0;
  expect_refused(context, core::Code::kInvalidArgument);
}

TEST(WorkerBaker, DamagedInputs_AreDataLoss) {
  BakerContext context = visibility_context();
  context.inputs[0].resize(context.inputs[0].size() / 2);
  expect_refused(context, core::Code::kDataLoss);
  context = basis_context();
  context.spec.mutable_basis()->set_resolution(2 * kResolution);
  expect_refused(context, core::Code::kDataLoss);
  context = transfer_context();
  context.inputs[1] = context.inputs[0];
  expect_refused(context, core::Code::kDataLoss);
}

TEST(WorkerFingerprint, IsTheSameEveryTime) {
  const core::Digest once = numerics_fingerprint();
  EXPECT_EQ(once, numerics_fingerprint());
  EXPECT_NE(once, core::Digest{});
}

}  // namespace
}  // namespace weft::worker
