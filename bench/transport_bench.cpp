// Rates of the precomputation's kernels on a 4/1 satin of full size, one thread:
//   cmake --build build --target bench_transport && build/bin/bench_transport

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <benchmark/benchmark.h>

#include "bench/machine_limits.h"
#include "core/random.h"
#include "core/resource_use.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "shading/fibre_bcsdf.h"
#include "transport/normal_equations.h"
#include "transport/pca.h"
#include "transport/sh_chunk.h"
#include "transport/signed_distance.h"
#include "transport/sphere.h"
#include "transport/transfer.h"
#include "transport/visibility.h"
#include "transport/visibility_raster.h"
#include "transport/visibility_sg.h"
#include "transport/wide.h"

namespace {

using namespace weft;  // NOLINT(google-build-using-namespace)

constexpr std::uint32_t kResolution = 128;
constexpr float kFar = std::numeric_limits<float>::infinity();

constexpr const char* kSatin = R"(
  name: "bench" seed: 7
  weave {
    matrix { rows: "XXXX." rows: "XX.XX" rows: ".XXXX" rows: "XXX.X" rows: "X.XXX" }
    ends_per_cm: 40 picks_per_cm: 40 warp_yarn: "y" weft_yarn: "y"
  }
  yarns {
    name: "y" material: "m" plies: 2 fibres_per_ply: 60 yarn_radius_mm: 0.11
    fibre_radius_mm: 0.006 ply_twist_per_cm: 6 fibre_twist_per_cm: -10
  }
  materials {
    name: "m" c_r { r: 0.2 g: 0.2 b: 0.2 } c_tt { r: 0.6 g: 0.7 b: 0.8 }
    beta_r_deg: 7 beta_tt_deg: 10 gamma_tt_deg: 25
  }
)";

const fabric::Tile& satin() {
  static const fabric::Tile tile =
      fabric::build_tile(fabric::parse_description(kSatin, "bench.textproto", "."));
  return tile;
}

const transport::Scene& scene() {
  static const transport::Scene built(satin());
  return built;
}

// What a kernel does each time.
struct Work {
  double multiply_adds = 0;
  double read_bytes = 0;  // of its inputs, each as often as it is gone through
};

// Runs a kernel and sets what it does against what the thread could do at best: multiply-adds, and
// reading from memory, whether its inputs come from there or lie in a cache.
template <class Kernel>
void measure(benchmark::State& state, const Work& work, const Kernel& kernel) {
  const bench::MachineLimits& limits = bench::machine_limits();
  const double cpu_before = core::thread_cpu_seconds();
  for (auto unused : state) {
    kernel();
  }
  const double seconds = core::thread_cpu_seconds() - cpu_before;
  const double times_per_s = static_cast<double>(state.iterations()) / seconds;
  state.counters["multiply_adds_per_s"] = work.multiply_adds * times_per_s;
  state.counters["share_of_multiply_adds"] =
      work.multiply_adds * times_per_s / limits.multiply_adds_per_s;
  state.counters["read_bytes_per_s"] = work.read_bytes * times_per_s;
  state.counters["share_of_memory"] = work.read_bytes * times_per_s / limits.read_bytes_per_s;
}

std::uint32_t some_segment(std::uint64_t i) {
  return core::Random(1, 0, i).below(satin().segment_count());
}

void visibility_rays(benchmark::State& state) {
  static_cast<void>(scene());
  std::uint64_t i = 0;
  for (auto unused : state) {
    benchmark::DoNotOptimize(transport::visibility_bits(scene(), some_segment(i++), kResolution));
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(i * kResolution * kResolution));
}
BENCHMARK(visibility_rays)->Unit(benchmark::kMillisecond);

const transport::VisibilityRaster& raster() {
  static const transport::VisibilityRaster built(scene(), kResolution);
  return built;
}

void visibility_raster(benchmark::State& state) {
  static_cast<void>(raster());
  std::uint64_t i = 0;
  for (auto unused : state) {
    benchmark::DoNotOptimize(raster().bits(some_segment(i++)));
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(i * kResolution * kResolution));
}
BENCHMARK(visibility_raster)->Unit(benchmark::kMillisecond);

std::vector<std::vector<std::uint8_t>> images(std::uint64_t count) {
  std::vector<std::vector<std::uint8_t>> all;
  for (std::uint64_t i = 0; i < count; ++i) {
    all.push_back(raster().bits(some_segment(i)));
  }
  return all;
}

void signed_distance(benchmark::State& state) {
  const auto some = images(64);
  const float limit =
      state.range(0) == 0 ? std::numbers::pi_v<float> : 1e-3f * static_cast<float>(state.range(0));
  const transport::DistanceTransform transform(kResolution, limit);
  std::vector<float> distances(std::size_t{kResolution} * kResolution);
  std::size_t i = 0;
  for (auto unused : state) {
    transform.measure(some[i++ % some.size()], distances);
    benchmark::DoNotOptimize(distances.data());
  }
}
BENCHMARK(signed_distance)->ArgName("limit_mrad")->Arg(0)->Arg(400)->Unit(benchmark::kMicrosecond);

void gaussian_weights(benchmark::State& state) {
  const auto some = images(64);
  const transport::SgRegions regions(48, kResolution);
  const std::uint16_t rotation = transport::sg_rotation(1, 2, kResolution);
  std::size_t i = 0;
  for (auto unused : state) {
    benchmark::DoNotOptimize(regions.weights(some[i++ % some.size()], rotation));
  }
}
BENCHMARK(gaussian_weights)->Unit(benchmark::kMicrosecond);

// Noise of a falling spectrum: what the images are does not change the time.
void pca(benchmark::State& state) {
  const auto count = static_cast<std::size_t>(state.range(0));
  constexpr std::uint32_t kPixels = kResolution * kResolution;
  std::vector<float> sample(count * kPixels);
  for (std::size_t n = 0; n < count; ++n) {
    core::Random random(5, static_cast<std::uint32_t>(n));
    for (std::uint32_t p = 0; p < kPixels; ++p) {
      sample[n * kPixels + p] = (random.uniform() - 0.5f) / (1 + 0.01f * static_cast<float>(p));
    }
  }
  // 64 columns to and fro in three iterations, and once more at the end; the mean is taken off
  // before.
  const auto values = static_cast<double>(sample.size());
  measure(state, {7.0 * 64 * values, 9.0 * sizeof(float) * values}, [&] {
    benchmark::DoNotOptimize(transport::principal_components(sample, kPixels, 48, 1));
  });
}
BENCHMARK(pca)->Arg(1024)->Arg(4096)->Unit(benchmark::kSecond)->Iterations(1);

// The step of a fit of 48 coefficients: 2,048 points of which half cost something.
void normal_equations(benchmark::State& state) {
  constexpr std::size_t kRows = 1024;
  constexpr std::size_t kWidth = 48;
  core::Random random(6, 0);
  std::vector<float> a(kRows * kWidth);
  std::vector<float> b(kRows);
  for (std::vector<float>* numbers : {&a, &b}) {
    for (float& number : *numbers) {
      number = random.uniform() - 0.5F;
    }
  }
  std::vector<float> matrix(kWidth * kWidth);
  std::vector<float> vector(kWidth);
  const bool is_wide = transport::wide_is_available();
  const Work work{kRows * kWidth * ((kWidth + 1) / 2.0 + 1),
                  static_cast<double>(sizeof(float) * (a.size() + b.size()))};
  measure(state, work, [&] {
    transport::form_normal_equations(a, b, kRows, is_wide, matrix, vector);
    benchmark::DoNotOptimize(matrix.data());
  });
}
BENCHMARK(normal_equations)->Unit(benchmark::kMicrosecond);

// What a chunk of paths of one light each adds to sums and sums of squares of order 5.
void transfer_sums_of_256(benchmark::State& state) {
  constexpr std::size_t kPaths = 256;
  transport::ShChunk chunk(5);
  std::vector<std::int64_t> sum(chunk.size());
  std::vector<std::int64_t> sum_of_squares(chunk.size());
  core::Random random(8, 0);
  std::vector<glm::vec3> directions;
  for (std::size_t i = 0; i <= kPaths; ++i) {
    directions.push_back(
        glm::normalize(glm::vec3(random.uniform(), random.uniform(), random.uniform()) - 0.5F));
  }
  const auto size = static_cast<double>(chunk.size());
  measure(state, {2.0 * size * kPaths, 2.0 * size * sizeof(std::int64_t)}, [&] {
    for (std::size_t i = 0; i < kPaths; ++i) {
      const transport::LightSample light{{0.5F, 0.4F, 0.3F}, directions[i]};
      chunk.add(directions[i + 1], {&light, 1});
    }
    chunk.flush(sum, sum_of_squares);
    benchmark::DoNotOptimize(sum.data());
  });
}
BENCHMARK(transfer_sums_of_256)->Unit(benchmark::kMicrosecond);

void paths(benchmark::State& state) {
  shading::FibreMaterial material;
  material.c_r = {0.2f, 0.2f, 0.2f};
  material.c_tt = {0.6f, 0.7f, 0.8f};
  material.beta_r = 0.12f;
  material.beta_tt = 0.17f;
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf(material)};
  transport::CellSegments cell;
  for (std::uint64_t i = 0; i < 64; ++i) {
    cell.segments.push_back(some_segment(0) + static_cast<std::uint32_t>(i) <
                                    satin().segment_count()
                                ? some_segment(0) + static_cast<std::uint32_t>(i)
                                : some_segment(0));
  }
  transport::TransferSettings settings;
  settings.estimator =
      state.range(0) == 0 ? transport::Estimator::kExit : transport::Estimator::kLight;
  std::uint64_t first = 0;
  for (auto unused : state) {
    benchmark::DoNotOptimize(
        transport::transfer_sums(scene(), materials, {0, &cell, first, 1024}, settings));
    first += 1024;
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(first));
}
BENCHMARK(paths)->ArgName("light")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
