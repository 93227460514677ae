#include "bench/transfer_study.h"

#include <cmath>
#include <ctime>

#include "core/error.h"
#include "core/moments.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "transport/cell_grid.h"
#include "worker/materials.h"

namespace weft::bench {

namespace {

constexpr std::uint32_t kFlights = 100000;
constexpr std::uint32_t kSeenRays = 16;

double thread_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::vector<shading::FibreBcsdf> materials_of(const v1::FabricDescription& description,
                                              const fabric::Tile& tile) {
  google::protobuf::RepeatedPtrField<v1::Material> materials;
  for (const std::string& name : tile.material_names) {
    for (const v1::Material& material : description.materials()) {
      if (material.name() == name) {
        *materials.Add() = material;
      }
    }
  }
  return worker::bcsdfs_of(materials, tile, "transfer");
}

std::vector<transport::CellSegments> cells_of(const transport::Scene& scene,
                                              const v1::FabricDescription& description) {
  const double path_mm = transport::mean_free_path(scene, kFlights, description.seed());
  const transport::CellGrid grid =
      transport::make_cell_grid(scene.tile(), path_mm * description.precompute().cell_length_mfp());
  return transport::segments_by_cell(
      grid.cell_of_segment, grid.cell_coordinates.size(),
      transport::seen_segments(scene, kSeenRays, description.seed()));
}

// Sums over runs of one method, of each run's mean and of its square.
struct Sums {
  std::vector<double> mean;
  std::vector<double> square;
};

CellEstimate estimate_of(const Sums& sums, std::uint32_t runs, std::uint64_t paths) {
  CellEstimate estimate;
  double variance = 0;
  for (std::size_t i = 0; i < sums.mean.size(); ++i) {
    const core::MeanAndError moments = core::mean_and_error(sums.mean[i], sums.square[i], runs);
    estimate.mean.push_back(moments.mean);
    estimate.squared_error.push_back(moments.standard_error * moments.standard_error);
    variance += estimate.squared_error.back() * runs;
  }
  estimate.path_variance = variance * static_cast<double>(paths);
  const std::size_t colour = estimate.mean.size() / 3;
  estimate.brightness = (estimate.mean[0] + estimate.mean[colour] + estimate.mean[2 * colour]) / 3;
  return estimate;
}

}  // namespace

TransferFabric::TransferFabric(const std::string& path)
    : tile(fabric::build_tile(fabric::load_description(path, v1::QUALITY_PAPER))), scene(tile) {
  const v1::FabricDescription description = fabric::load_description(path, v1::QUALITY_PAPER);
  name = description.name();
  materials = materials_of(description, tile);
  cells = cells_of(scene, description);
}

std::vector<CellEstimate> estimate_cell(const TransferFabric& fabric, std::uint32_t cell,
                                        std::uint32_t runs,
                                        const std::vector<TransferMethod>& methods,
                                        std::vector<double>& cpu_seconds) {
  std::vector<Sums> sums(methods.size());
  for (std::uint32_t run = 0; run < runs; ++run) {
    for (std::size_t m = 0; m < methods.size(); ++m) {
      transport::TransferSettings settings = methods[m].settings;
      settings.seed = 1000 * (m + 1) + run;
      const double before = thread_cpu_seconds();
      const transport::TransferSums found =
          transport::transfer_sums(fabric.scene, fabric.materials,
                                   {cell, &fabric.cells[cell], 0, methods[m].paths}, settings);
      cpu_seconds[m] += thread_cpu_seconds() - before;
      sums[m].mean.resize(found.sum.size());
      sums[m].square.resize(found.sum.size());
      for (std::size_t i = 0; i < found.sum.size(); ++i) {
        const double mean =
            core::from_fixed_point(found.sum[i]) / static_cast<double>(methods[m].paths);
        sums[m].mean[i] += mean;
        sums[m].square[i] += mean * mean;
      }
    }
  }
  std::vector<CellEstimate> estimates;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    estimates.push_back(estimate_of(sums[m], runs, methods[m].paths));
  }
  return estimates;
}

Spread spread_of(const std::vector<double>& values) {
  double sum = 0;
  double squares = 0;
  for (const double value : values) {
    sum += value;
    squares += value * value;
  }
  const core::MeanAndError moments =
      core::mean_and_error(sum, squares, static_cast<double>(values.size()));
  return {moments.mean, moments.standard_error};
}

double chi_square(const CellEstimate& a, const CellEstimate& b) {
  double differences = 0;
  double errors = 0;
  for (std::size_t i = 0; i < a.mean.size(); ++i) {
    differences += (a.mean[i] - b.mean[i]) * (a.mean[i] - b.mean[i]);
    errors += a.squared_error[i] + b.squared_error[i];
  }
  return errors > 0 ? differences / errors : 1;
}

}  // namespace weft::bench
