#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/plan.h"
#include "core/error.h"
#include "core/half.h"
#include "core/moments.h"
#include "core/random.h"
#include "fabric/tile.h"
#include "proto/arrays.h"
#include "shading/scattering_orders.h"

// A job of made-up results: each number tells where it stands.
namespace weft::coordinator::test {

inline constexpr std::uint32_t kResolution = 8;
inline constexpr std::uint32_t kComponents = 4;
inline constexpr std::uint32_t kSgCount = 3;
inline constexpr std::uint32_t kOrder = 1;
inline constexpr std::uint64_t kEntries = 4;  // (order + 1)^2
inline constexpr std::uint32_t kPathsPerCell = 40'000;
inline constexpr std::uint32_t kCells = 2;

template <class T>
void add(v1::Arrays& arrays, const char* name, std::vector<std::uint64_t> shape,
         const std::vector<T>& data) {
  v1::add_array<T>(arrays, name, std::move(shape), std::span<const T>(data));
}

inline v1::FabricDescription description() {
  v1::FabricDescription d;
  d.set_name("synthetic");
  d.set_seed(7);
  v1::Material& silk = *d.add_materials();
  silk.set_name("silk");
  silk.mutable_c_r()->set_g(0.25);
  silk.mutable_c_tt()->set_b(0.5);
  silk.set_beta_r_deg(10);
  silk.set_beta_tt_deg(20);
  silk.set_gamma_tt_deg(30);
  v1::Precompute& p = *d.mutable_precompute();
  p.set_quality(v1::QUALITY_PREVIEW);
  p.set_sh_order(kOrder);
  p.set_cell_length_mfp(1);
  p.set_paths_per_cell(kPathsPerCell);
  p.set_transfer_estimator(v1::TRANSFER_ESTIMATOR_EXIT);
  p.set_visibility_resolution(kResolution);
  p.set_pca_components(kComponents);
  p.set_pca_sample_segments(64);
  p.set_sg_count(kSgCount);
  p.set_sg_sharpness(128);
  p.set_max_path_length(100);
  return d;
}

// Two strands of 100 and 50 segments: three shards of visibility.
inline fabric::Tile tile() {
  fabric::Tile t;
  t.size_mm = {1, 1};
  t.z_min_mm = -0.1F;
  t.z_max_mm = 0.1F;
  t.material_names = {"silk"};
  t.yarn_names = {"yarn"};
  t.threads = {{0, fabric::Role::kWarp, 0}};
  t.strands = {{0, 101, 0, 0, 0.01F, 0, 0}, {101, 51, 0, 0, 0.01F, 0, 0}};
  for (int i = 0; i < 152; ++i) {
    t.points_mm.emplace_back(0.01F * static_cast<float>(i), 0.0F, 0.0F);
  }
  fabric::index_segments(t);
  return t;
}

// Numbers that tell which result and which element they are.
inline std::uint16_t half_at(std::uint64_t segment, std::uint64_t i) {
  return core::half_from_float(static_cast<float>(segment % 128) / 128.0F +
                               static_cast<float>(i) / 1024.0F);
}

inline std::vector<float> ramp(std::uint64_t count, float step) {
  std::vector<float> values(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    values[i] = step * static_cast<float>(i);
  }
  return values;
}

inline v1::Arrays grid_result() {
  v1::Arrays arrays;
  add<float>(arrays, "mean_free_path_mm", {1}, {0.125F});
  add<std::uint32_t>(arrays, "cells_per_axis", {3}, {2, 1, 1});
  std::vector<std::uint32_t> cell_of_segment(150);
  std::fill(cell_of_segment.begin() + 70, cell_of_segment.end(), 1);
  add(arrays, "cell_of_segment", {150}, cell_of_segment);
  add<std::uint32_t>(arrays, "cell_coordinates", {2, 3}, {0, 0, 0, 1, 0, 0});
  return arrays;
}

inline v1::Arrays coefficients_result(std::uint64_t shard, std::uint64_t shards) {
  std::vector<v1::Half> ssdf;
  std::vector<v1::Half> ssg;
  std::vector<v1::Half> open;
  std::vector<std::uint32_t> rotation;
  for (std::uint64_t segment = shard; segment < 150; segment += shards) {
    for (std::uint64_t i = 0; i < kComponents; ++i) {
      ssdf.push_back({half_at(segment, i)});
    }
    for (std::uint64_t i = 0; i < kSgCount; ++i) {
      ssg.push_back({half_at(segment, i + 10)});
    }
    open.push_back({core::half_from_float(static_cast<float>(segment) / 256.0F)});
    rotation.push_back(static_cast<std::uint32_t>(segment * 400));
  }
  v1::Arrays arrays;
  const std::uint64_t n = open.size();
  add(arrays, "ssdf", {n, kComponents}, ssdf);
  add(arrays, "ssg", {n, kSgCount}, ssg);
  add(arrays, "open_share", {n}, open);
  add(arrays, "rotation", {n}, rotation);
  const auto index = static_cast<std::uint32_t>(shard);
  add<std::uint32_t>(arrays, "sign_errors", {2}, {1 + index, 100});
  return arrays;
}

// One sample of a path's contribution to matrix entry i.
inline double sample(std::uint64_t cell, std::uint64_t path, std::uint64_t i) {
  core::Random random(99, static_cast<std::uint32_t>(cell), path * 64 + i);
  return 0.5 + static_cast<double>(i) + 0.1 * random.uniform_double();
}

inline v1::Arrays transfer_result(std::uint64_t cell, std::uint64_t first, std::uint64_t count) {
  std::vector<std::int64_t> sum(3 * kEntries * kEntries);
  std::vector<std::int64_t> squares(sum.size());
  for (std::uint64_t path = first; path < first + count; path += 100) {  // 1 in 100 contributes
    for (std::uint64_t i = 0; i < sum.size(); ++i) {
      const double x = sample(cell, path, i);
      sum[i] += core::to_fixed_point(x);
      squares[i] += core::to_fixed_point(x * x);
    }
  }
  v1::Arrays arrays;
  add<std::uint64_t>(arrays, "paths", {1}, {count});
  add(arrays, "sum", {3, kEntries, kEntries}, sum);
  add(arrays, "sum_of_squares", {3, kEntries, kEntries}, squares);
  // All of the light was scattered once, half of it by C_R.
  std::vector<std::int64_t> numbers(std::size_t{shading::kOrderBins} * 3 * 4);
  for (std::size_t c = 0; c < 3; ++c) {
    const std::int64_t light = core::to_fixed_point(static_cast<double>(count));
    numbers[4 * c] = light;
    numbers[4 * c + 1] = light;
    numbers[4 * c + 2] = light / 2;
    numbers[4 * c + 3] = light / 2;
  }
  add(arrays, "order_numbers", {1, shading::kOrderBins, 3, 4}, numbers);
  add(arrays, "order_shapes", {shading::kOrderShapes, kEntries, kEntries},
      std::vector<std::int64_t>(shading::kOrderShapes * kEntries * kEntries));
  return arrays;
}

// Light that falls off as the normal distribution of 24 bins does.
inline v1::Arrays shadow_result(const Stage& stage, std::uint64_t shard) {
  const v1::ShadowSpec& spec = stage.spec.shadow();
  std::vector<std::int64_t> sum;
  for (std::uint32_t i = 0; i <= spec.bins(); ++i) {
    const double upper = i < spec.bins() ? std::erf((i + 1) / (24 * std::sqrt(2.0))) : 1;
    const double lower = std::erf(i / (24 * std::sqrt(2.0)));
    sum.push_back(core::to_fixed_point(static_cast<double>(1 + shard) * (upper - lower)));
  }
  v1::Arrays arrays;
  add<std::uint64_t>(arrays, "paths", {1}, {spec.paths_per_shard()});
  add(arrays, "sum", {sum.size()}, sum);
  return arrays;
}

inline v1::Arrays result_of(const Stage& stage, std::uint64_t shard) {
  v1::Arrays arrays;
  switch (stage.name) {
    case StageName::kGeometry:
      return v1::parse_arrays(fabric::encode_tile(tile()));
    case StageName::kGrid:
      return grid_result();
    case StageName::kVisibility:
      add<std::uint8_t>(arrays, "bits", {1, 1}, {static_cast<std::uint8_t>(shard)});
      return arrays;
    case StageName::kBasis:
      add(arrays, "mean", {64}, ramp(64, 0.01F));
      add(arrays, "components", {kComponents, 64}, ramp(kComponents * std::uint64_t{64}, -0.01F));
      add(arrays, "variance", {kComponents}, ramp(kComponents, 1));
      return arrays;
    case StageName::kCoefficients:
      return coefficients_result(shard, stage.shard_count);
    case StageName::kTransfer: {
      const std::uint64_t blocks = stage.shard_count / kCells;
      const std::uint64_t first = shard % blocks * stage.spec.transfer().paths_per_shard();
      const std::uint64_t count =
          std::min<std::uint64_t>(stage.spec.transfer().paths_per_shard(), kPathsPerCell - first);
      return transfer_result(shard / blocks, first, count);
    }
    case StageName::kShadow:
      return shadow_result(stage, shard);
  }
  return arrays;
}

}  // namespace weft::coordinator::test
