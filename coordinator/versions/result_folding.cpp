#include "coordinator/versions/result_folding.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "coordinator/versions/shard_result.h"
#include "core/moments.h"
#include "core/parallel.h"
#include "fabric/tile.h"
#include "proto/arrays.h"
#include "shading/shadow_fit.h"

namespace weft::coordinator {

namespace {

// Row i of a strided shard goes to row shard + i * shards of the whole.
struct Stride {
  std::uint64_t shard;
  std::uint64_t shards;
  std::uint64_t width;
};

void scatter(const std::vector<v1::Half>& rows, const Stride& stride,
             std::vector<std::uint16_t>& whole) {
  for (std::uint64_t i = 0; i < rows.size() / stride.width; ++i) {
    const std::uint64_t row = stride.shard + i * stride.shards;
    for (std::uint64_t j = 0; j < stride.width; ++j) {
      whole[row * stride.width + j] = rows[i * stride.width + j].bits;
    }
  }
}

}  // namespace

void fold_geometry(const FinishedStage& geometry, const ReadBlob& read_blob,
                   storage::FabricDatabase& database) {
  const std::string bytes = read_blob(geometry.shards.front());
  const fabric::Tile tile =
      naming("stage geometry, shard 0", [&bytes] { return fabric::decode_tile(bytes); });
  database.size_mm = tile.size_mm;
  database.z_bounds_mm = {tile.z_min_mm, tile.z_max_mm};
  database.blocks = tile.blocks;
  database.material_names = tile.material_names;
  database.yarn_names = tile.yarn_names;
  for (const fabric::Thread& thread : tile.threads) {
    database.threads.insert(database.threads.end(),
                            {thread.yarn, static_cast<std::uint32_t>(thread.role), thread.index});
  }
  for (const fabric::Strand& strand : tile.strands) {
    database.strands.insert(database.strands.end(),
                            {strand.point_count, strand.material, strand.thread});
    database.strand_periods.insert(database.strand_periods.end(),
                                   {strand.period_x, strand.period_y});
    database.strand_radius_mm.push_back(strand.radius_mm);
  }
  database.points_mm.reserve(3 * tile.points_mm.size());
  for (const glm::vec3& point : tile.points_mm) {
    database.points_mm.insert(database.points_mm.end(), {point.x, point.y, point.z});
  }
}

void fold_grid(const FinishedStage& grid, const ReadBlob& read_blob,
               storage::FabricDatabase& database) {
  const ShardResult result(grid, 0, read_blob);
  const std::uint64_t segments = database.points_mm.size() / 3 - database.strand_radius_mm.size();
  const std::vector<std::uint64_t> shape = result.shape_of<std::uint32_t>("cell_coordinates");
  result.require(shape.size() == 2 && shape[0] > 0, "array 'cell_coordinates' is not [cells, 3]");
  const std::uint64_t cells = shape[0];

  database.mean_free_path_mm = result.array<float>("mean_free_path_mm", {1})[0];
  result.require(std::isfinite(database.mean_free_path_mm) && database.mean_free_path_mm > 0,
                 "the mean free path is not positive");
  const auto axes = result.array<std::uint32_t>("cells_per_axis", {3});
  database.cells_per_axis = {axes[0], axes[1], axes[2]};
  database.cell_of_segment = result.array<std::uint32_t>("cell_of_segment", {segments});
  result.require(std::all_of(database.cell_of_segment.begin(), database.cell_of_segment.end(),
                             [cells](std::uint32_t cell) { return cell < cells; }),
                 "a segment names a cell that is missing");
  database.cell_coordinates = result.array<std::uint32_t>("cell_coordinates", {cells, 3});
  for (std::size_t i = 0; i < database.cell_coordinates.size(); ++i) {
    result.require(database.cell_coordinates[i] < axes[i % 3], "a cell lies outside the grid");
  }
}

void fold_basis(const FinishedStage& basis, const ReadBlob& read_blob,
                storage::FabricDatabase& database) {
  const v1::BasisSpec& spec = basis.stage.spec.basis();
  const std::uint64_t pixels = std::uint64_t{spec.resolution()} * spec.resolution();
  const ShardResult result(basis, 0, read_blob);
  database.visibility_resolution = spec.resolution();
  database.pca_components = spec.components();
  database.ssdf_mean = result.array<float>("mean", {pixels});
  database.ssdf_basis = result.array<float>("components", {spec.components(), pixels});
  result.require(all_finite(database.ssdf_mean) && all_finite(database.ssdf_basis),
                 "a number is not finite");
}

void fold_coefficients(const FinishedStage& coefficients,
                       const std::vector<std::uint64_t>& basis_shards, const ReadBlob& read_blob,
                       storage::FabricDatabase& database) {
  const v1::CoefficientsSpec& spec = coefficients.stage.spec.coefficients();
  const std::uint64_t segments = database.cell_of_segment.size();
  const std::uint64_t shards = coefficients.shards.size();
  const std::uint64_t components = database.pca_components;
  database.sg_count = spec.sg_count();
  database.sg_sharpness = static_cast<float>(spec.sg_sharpness());
  database.ssdf.resize(segments * components);
  database.ssg.resize(segments * spec.sg_count());
  database.open_share.resize(segments);
  database.ssg_rotation.resize(segments);
  const bool has_held_out = basis_shards.size() < shards;
  std::atomic<std::uint64_t> wrong{0};
  std::atomic<std::uint64_t> compared{0};
  core::in_parallel(shards, [&](std::size_t shard) {
    const ShardResult result(coefficients, shard, read_blob);
    const std::uint64_t rows = (segments - shard + shards - 1) / shards;
    const auto ssdf = result.array<v1::Half>("ssdf", {rows, components});
    const auto ssg = result.array<v1::Half>("ssg", {rows, spec.sg_count()});
    const auto open_share = result.array<v1::Half>("open_share", {rows});
    const auto rotation = result.array<std::uint32_t>("rotation", {rows});
    const auto sign_errors = result.array<std::uint32_t>("sign_errors", {2});
    result.require(all_finite(ssdf) && all_finite(ssg) && all_finite(open_share),
                   "a number is not finite");
    result.require(sign_errors[0] <= sign_errors[1], "more signs are wrong than were compared");
    scatter(ssdf, {shard, shards, components}, database.ssdf);
    scatter(ssg, {shard, shards, spec.sg_count()}, database.ssg);
    scatter(open_share, {shard, shards, 1}, database.open_share);
    for (std::uint64_t i = 0; i < rows; ++i) {
      result.require(rotation[i] <= 0xffff, "a rotation is more than a turn");
      database.ssg_rotation[shard + i * shards] = static_cast<std::uint16_t>(rotation[i]);
    }
    if (!has_held_out || !std::binary_search(basis_shards.begin(), basis_shards.end(), shard)) {
      wrong += sign_errors[0];
      compared += sign_errors[1];
    }
  });
  database.ssdf_sign_error =
      compared == 0 ? 0 : static_cast<double>(wrong) / static_cast<double>(compared);
}

double fold_shadow(const FinishedStage& shadow, const ReadBlob& read_blob,
                   storage::FabricDatabase& database) {
  constexpr double kUnlitSigmaMfp = 2;
  const v1::ShadowSpec& spec = shadow.stage.spec.shadow();
  std::vector<double> light(std::size_t{spec.bins()} + 1, 0.0);
  for (std::uint64_t shard = 0; shard < shadow.shards.size(); ++shard) {
    const ShardResult result(shadow, shard, read_blob);
    const std::uint64_t planned = std::min<std::uint64_t>(
        spec.paths_per_shard(), spec.paths() - shard * spec.paths_per_shard());
    result.require(result.array<std::uint64_t>("paths", {1})[0] == planned,
                   "it has not the paths that were planned");
    const auto sum = result.array<std::int64_t>("sum", {light.size()});
    result.require(std::all_of(sum.begin(), sum.end(), [](auto s) { return s >= 0; }),
                   "a sum of light is negative");
    for (std::size_t i = 0; i < sum.size(); ++i) {
      light[i] += core::from_fixed_point(sum[i]);
    }
  }
  const double bin_mm = spec.bin_mfp() * static_cast<double>(database.mean_free_path_mm);
  if (!std::any_of(light.begin(), light.end() - 1, [](double part) { return part > 0; })) {
    database.sigma_shadow_mm = static_cast<float>(kUnlitSigmaMfp / spec.bin_mfp() * bin_mm);
    return 0;
  }
  const shading::ShadowFit fit = shading::fit_shadow(light);
  database.sigma_shadow_mm = static_cast<float>(fit.sigma * bin_mm);
  return fit.error;
}

}  // namespace weft::coordinator
