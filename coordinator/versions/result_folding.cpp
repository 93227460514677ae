#include "coordinator/versions/result_folding.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "core/error.h"
#include "core/half.h"
#include "core/moments.h"
#include "core/stopping.h"
#include "fabric/tile.h"
#include "proto/arrays.h"
#include "shading/scattering_orders.h"
#include "shading/shadow_fit.h"

namespace weft::coordinator {

namespace {

// Sums over all shards of a cell: no number of paths overflows it.
__extension__ typedef __int128 WideSum;

[[noreturn]] void refuse_result(const std::string& name, const std::string& what) {
  throw core::Error(core::Code::kDataLoss, name + ": the result is malformed: " + what +
                                               "; delete it and compute it again");
}

// The envelope's own errors know neither stage nor shard: `name` says them.
template <class Function>
std::invoke_result_t<Function> naming(const std::string& name, Function function) {
  try {
    return function();
  } catch (const core::Error& error) {
    refuse_result(name, error.what());
  }
}

// The result of one shard, read array by array.
class ShardResult {
 public:
  ShardResult(const FinishedStage& finished, std::uint64_t shard, const ReadBlob& read_blob)
      : name_(std::string("stage ") + to_string(finished.stage.name) + ", shard " +
              std::to_string(shard)) {
    const std::string bytes = read_blob(finished.shards[shard]);
    arrays_ = naming(name_, [&] { return v1::parse_arrays(bytes); });
  }

  // Array `name`, which must have this shape.
  template <class T>
  [[nodiscard]] std::vector<T> array(const char* name,
                                     const std::vector<std::uint64_t>& expected) const {
    std::vector<std::uint64_t> shape;
    std::vector<T> data = naming(name_, [&] { return v1::array_of<T>(arrays_, name, &shape); });
    if (shape != expected) {
      refuse(std::string("array '") + name + "' has shape " + text_of(shape) + " where " +
             text_of(expected) + " was planned");
    }
    return data;
  }

  // The extents of array `name`.
  template <class T>
  [[nodiscard]] std::vector<std::uint64_t> shape_of(const char* name) const {
    std::vector<std::uint64_t> shape;
    naming(name_, [&] { return v1::array_of<T>(arrays_, name, &shape); });
    return shape;
  }

  [[noreturn]] void refuse(const std::string& what) const { refuse_result(name_, what); }

  void require(bool holds, const char* what) const {
    if (!holds) {
      refuse(what);
    }
  }

 private:
  static std::string text_of(const std::vector<std::uint64_t>& shape) {
    std::string text = "[";
    for (const std::uint64_t extent : shape) {
      text += (text.size() > 1 ? ", " : "") + std::to_string(extent);
    }
    return text + "]";
  }

  std::string name_;
  v1::Arrays arrays_;
};

bool all_finite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

bool all_finite(const std::vector<v1::Half>& values) {
  constexpr std::uint16_t kExponent = 0x7c00;
  return std::all_of(values.begin(), values.end(),
                     [](v1::Half v) { return (v.bits & kExponent) != kExponent; });
}

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

// Sums over the shards of one cell.
struct CellSums {
  std::uint64_t paths = 0;
  std::vector<WideSum> sum;
  std::vector<WideSum> sum_of_squares;
  std::vector<WideSum> order_numbers;
  std::vector<WideSum> order_shapes;
};

void add_to(std::vector<WideSum>& sums, const std::vector<std::int64_t>& more) {
  sums.resize(more.size(), 0);
  for (std::size_t i = 0; i < more.size(); ++i) {
    sums[i] += more[i];
  }
}

// Whether the results of this stage tell orders of scattering apart.
bool has_orders(const v1::TransferSpec& spec) {
  const auto materials = static_cast<std::size_t>(spec.materials_size());
  return spec.estimator() == v1::TRANSFER_ESTIMATOR_EXIT && materials >= 1 &&
         materials <= shading::kMostCountedMaterials;
}

void add_orders(const ShardResult& result, const v1::TransferSpec& spec, CellSums& cell) {
  const auto materials = static_cast<std::size_t>(spec.materials_size());
  const std::uint64_t low = shading::shape_coefficients(spec.sh_order());
  const auto numbers = result.array<std::int64_t>(
      "order_numbers", {shading::order_groups(materials), shading::kOrderBins, 3,
                        1 + shading::order_counts(materials)});
  result.require(std::all_of(numbers.begin(), numbers.end(), [](auto n) { return n >= 0; }),
                 "light or a count of its scatterings is negative");
  add_to(cell.order_numbers, numbers);
  add_to(cell.order_shapes,
         result.array<std::int64_t>("order_shapes", {shading::kOrderShapes, low, low}));
}

std::uint16_t half_of(double value) {
  constexpr double kLargestHalf = 65504;
  return core::half_from_float(static_cast<float>(std::clamp(value, -kLargestHalf, kLargestHalf)));
}

double mean_of(WideSum sum, std::uint64_t paths) {
  return paths == 0
             ? 0
             : static_cast<double>(sum) / core::kFixedPointScale / static_cast<double>(paths);
}

// Light, mean counts of it and shapes of one cell.
void fold_orders(const CellSums& cell, std::size_t materials, storage::Recolouring& recolouring) {
  const std::size_t width = 1 + shading::order_counts(materials);
  for (std::size_t row = 0; row < cell.order_numbers.size(); row += width) {
    const WideSum light = cell.order_numbers[row];
    recolouring.order_light.push_back(half_of(mean_of(light, cell.paths)));
    for (std::size_t k = 1; k < width; ++k) {
      const double count =
          light > 0 ? static_cast<double>(cell.order_numbers[row + k]) / static_cast<double>(light)
                    : 0;
      recolouring.order_counts.push_back(half_of(count));
    }
  }
  for (const WideSum sum : cell.order_shapes) {
    recolouring.order_shapes.push_back(half_of(mean_of(sum, cell.paths)));
  }
}

void add_shard(const FinishedStage& transfer, std::uint64_t shard, const ReadBlob& read_blob,
               CellSums& cell) {
  const v1::TransferSpec& spec = transfer.stage.spec.transfer();
  const std::uint64_t n = std::uint64_t{spec.sh_order() + 1} * (spec.sh_order() + 1);
  const ShardResult result(transfer, shard, read_blob);
  const auto paths = result.array<std::uint64_t>("paths", {1});
  const auto sum = result.array<std::int64_t>("sum", {3, n, n});
  const auto sum_of_squares = result.array<std::int64_t>("sum_of_squares", {3, n, n});
  result.require(paths[0] <= spec.paths_per_shard(), "it has more paths than a shard holds");
  result.require(
      std::all_of(sum_of_squares.begin(), sum_of_squares.end(), [](auto s) { return s >= 0; }),
      "a sum of squares is negative");
  if (spec.target_standard_error() > 0) {
    result.require(core::ends_at({spec.target_standard_error(), spec.paths_per_cell()},
                                 {sum, sum_of_squares, paths[0]}),
                   "its paths end where the target standard error lets none end");
  }
  cell.paths += paths[0];
  add_to(cell.sum, sum);
  add_to(cell.sum_of_squares, sum_of_squares);
  if (has_orders(spec)) {
    add_orders(result, spec, cell);
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
  std::uint64_t wrong = 0;
  std::uint64_t compared = 0;
  for (std::uint64_t shard = 0; shard < shards; ++shard) {
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
  }
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

void fold_transfer(const FinishedStage& transfer, const ReadBlob& read_blob,
                   storage::FabricDatabase& database, storage::Recolouring& recolouring) {
  const v1::TransferSpec& spec = transfer.stage.spec.transfer();
  const std::uint64_t n = std::uint64_t{spec.sh_order() + 1} * (spec.sh_order() + 1);
  const std::uint64_t cells = database.cell_coordinates.size() / 3;
  const std::uint64_t blocks = transfer.shards.size() / cells;
  database.sh_order = spec.sh_order();
  database.transfer.reserve(cells * 3 * n * n);
  database.transfer_se.reserve(cells * 3 * n * n);
  for (std::uint64_t cell = 0; cell < cells; ++cell) {
    CellSums sums;
    for (std::uint64_t block = 0; block < blocks; ++block) {
      add_shard(transfer, cell * blocks + block, read_blob, sums);
    }
    if (spec.target_standard_error() == 0 && sums.paths != spec.paths_per_cell()) {
      throw core::Error(core::Code::kDataLoss,
                        "stage transfer, shards " + std::to_string(cell * blocks) + " to " +
                            std::to_string(cell * blocks + blocks - 1) + ": they have " +
                            std::to_string(sums.paths) + " paths together where " +
                            std::to_string(spec.paths_per_cell()) +
                            " were planned; delete them and compute them again");
    }
    database.cell_paths.push_back(sums.paths);
    fold_orders(sums, static_cast<std::size_t>(spec.materials_size()), recolouring);
    for (std::size_t i = 0; i < sums.sum.size(); ++i) {
      const core::MeanAndError moments =
          core::mean_and_error(static_cast<double>(sums.sum[i]) / core::kFixedPointScale,
                               static_cast<double>(sums.sum_of_squares[i]) / core::kFixedPointScale,
                               static_cast<double>(sums.paths));
      database.transfer.push_back(static_cast<float>(moments.mean));
      database.transfer_se.push_back(static_cast<float>(moments.standard_error));
    }
  }
}

}  // namespace weft::coordinator
