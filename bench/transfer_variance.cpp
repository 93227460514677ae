// Variance per CPU second of the ways to estimate transfer matrices, against the paper's in the
// same run, and whether all have one expectation: exits with 1 where they do not.
//   cmake --build build --target bench_transfer_variance
//   build/bin/bench_transfer_variance examples/gabardine.textproto examples/silk_plain.textproto
//     bench/fabrics/cotton_twill.textproto

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bench/transfer_study.h"

namespace weft::bench {
namespace {

constexpr double kPathsOfThePaper = 50000;
// Standard errors, estimated from some tens of cells, that a difference may have (0.0005 each).
constexpr double kLimit = 3.7;

struct Options {
  std::vector<std::string> fabrics;
  std::uint32_t cells = 24;
  std::uint32_t runs = 8;
  std::uint32_t order = 5;
  std::uint64_t light_paths = 4096;
  std::uint64_t exit_paths = 2048;
};

// The paper's first: all others are compared with it.
std::vector<TransferMethod> methods_of(const Options& options) {
  transport::TransferSettings exit;
  exit.sh_order = options.order;
  transport::TransferSettings light = exit;
  light.estimator = transport::Estimator::kLight;
  return {{"light (the paper's)", light, options.light_paths}, {"exit", exit, options.exit_paths}};
}

// What all cells together say of one method.
struct MethodResult {
  double path_variance = 0;  // mean over cells
  double path_seconds = 0;
  std::vector<double> gains_without;  // ratio of variances to the paper's, one cell left out each
  Spread chi_square;                  // against the paper's
  Spread brightness;                  // difference to the paper's, of its mean
};

std::vector<MethodResult> compare(const std::vector<std::vector<CellEstimate>>& cells,
                                  const std::vector<TransferMethod>& methods,
                                  const std::vector<double>& cpu_seconds, std::uint32_t runs) {
  std::vector<MethodResult> results(methods.size());
  double paper_brightness = 0;
  std::vector<double> totals(methods.size());
  for (const std::vector<CellEstimate>& cell : cells) {
    paper_brightness += cell[0].brightness / static_cast<double>(cells.size());
    for (std::size_t m = 0; m < methods.size(); ++m) {
      totals[m] += cell[m].path_variance;
    }
  }
  for (std::size_t m = 0; m < methods.size(); ++m) {
    MethodResult& result = results[m];
    std::vector<double> chi_squares;
    std::vector<double> brighter;
    for (const std::vector<CellEstimate>& cell : cells) {
      chi_squares.push_back(chi_square(cell[m], cell[0]));
      brighter.push_back((cell[m].brightness - cell[0].brightness) / paper_brightness);
      result.gains_without.push_back((totals[0] - cell[0].path_variance) /
                                     (totals[m] - cell[m].path_variance));
    }
    const auto count = static_cast<double>(cells.size());
    result.path_variance = totals[m] / count;
    result.path_seconds = cpu_seconds[m] / (count * runs * static_cast<double>(methods[m].paths));
    result.chi_square = spread_of(chi_squares);
    result.brightness = spread_of(brighter);
  }
  return results;
}

// Prints the rows of a fabric; false when a method disagrees with the paper's.
bool print_rows(const std::string& fabric, const std::vector<TransferMethod>& methods,
                const std::vector<MethodResult>& results) {
  const MethodResult& paper = results.front();
  bool agree = true;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const MethodResult& result = results[m];
    const double speed = paper.path_seconds / result.path_seconds;
    const double gain = paper.path_variance / result.path_variance * speed;
    // The jackknife's error of the ratio of variances, that of the times not counted.
    const auto count = static_cast<double>(result.gains_without.size());
    const double error = spread_of(result.gains_without).error * speed * (count - 1);
    const double paths = kPathsOfThePaper * result.path_variance / paper.path_variance;
    std::printf("| %s | %s | %.2f | %.3g | %.1f ± %.1f | %.0f | %.1f |", fabric.c_str(),
                methods[m].name.c_str(), 1e6 * result.path_seconds, result.path_variance, gain,
                error, paths, 1000 * paths * result.path_seconds);
    if (m == 0) {
      std::printf(" | |\n");
      continue;
    }
    const bool agrees = result.chi_square.mean - 1 < kLimit * result.chi_square.error &&
                        std::abs(result.brightness.mean) < kLimit * result.brightness.error;
    std::printf(" %.3f ± %.3f | %.2f ± %.2f %%%s |\n", result.chi_square.mean,
                result.chi_square.error, 100 * result.brightness.mean,
                100 * result.brightness.error, agrees ? "" : " WRONG");
    agree = agree && agrees;
  }
  std::fflush(stdout);
  return agree;
}

bool measure(const std::string& path, const Options& options) {
  const TransferFabric fabric(path);
  const std::vector<TransferMethod> methods = methods_of(options);
  const auto available = static_cast<std::uint32_t>(fabric.cells.size());
  const std::uint32_t count = std::min(options.cells, available);
  std::fprintf(stderr, "%s: %u segments, %u cells, %u of them measured\n", fabric.name.c_str(),
               fabric.tile.segment_count(), available, count);
  std::vector<double> cpu_seconds(methods.size());
  std::vector<std::vector<CellEstimate>> cells;
  for (std::uint32_t n = 0; n < count; ++n) {
    const auto cell =
        static_cast<std::uint32_t>(std::uint64_t{2 * n + 1} * available / (2 * count));
    cells.push_back(estimate_cell(fabric, cell, options.runs, methods, cpu_seconds));
  }
  return print_rows(fabric.name, methods, compare(cells, methods, cpu_seconds, options.runs));
}

int run(int argc, char** argv) {
  CLI::App app("Variance per CPU second of the estimators of transfer matrices");
  Options options;
  app.add_option("FABRIC", options.fabrics, "Descriptions")->required()->check(CLI::ExistingFile);
  app.add_option("--cells", options.cells, "Cells of each fabric, evenly chosen")
      ->check(CLI::Range(2, 100000));
  app.add_option("--runs", options.runs, "Seeds for each cell and method")
      ->check(CLI::Range(2, 1000));
  app.add_option("--order", options.order, "Order of the harmonics")->check(CLI::Range(0, 5));
  app.add_option("--light-paths", options.light_paths, "Paths of a run of the paper's estimator")
      ->check(CLI::Range(1, 1 << 20));
  app.add_option("--exit-paths", options.exit_paths, "Paths of a run of the others")
      ->check(CLI::Range(1, 1 << 20));
  CLI11_PARSE(app, argc, argv);
  std::printf(
      "| fabric | estimator | µs a path | variance of a path | less variance per CPU second | "
      "paths for the error of 50,000 | CPU s for 1,000 cells | chi-square | brighter |\n"
      "|---|---|---:|---:|---:|---:|---:|---:|---:|\n");
  bool agree = true;
  for (const std::string& fabric : options.fabrics) {
    agree = measure(fabric, options) && agree;
  }
  if (!agree) {
    std::fprintf(stderr, "estimators disagree: a wrong fast answer is none\n");
  }
  return agree ? 0 : 1;
}

}  // namespace
}  // namespace weft::bench

int main(int argc, char** argv) {
  try {
    return weft::bench::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
