#include "bench/machine_limits.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <vector>

#include <benchmark/benchmark.h>
#include <immintrin.h>

#include "core/resource_use.h"
#include "transport/wide.h"

namespace weft::bench {

namespace {

constexpr int kRepetitions = 5;
constexpr std::size_t kChains = 16;          // of multiply-adds that do not wait for one another
constexpr std::uint64_t kSteps = 4'000'000;  // of each chain

// Each leaves the sums where the compiler must believe that somebody reads them.
double chains_of_8() {
  __m256 sum[kChains];
  std::fill(std::begin(sum), std::end(sum), _mm256_set1_ps(1));
  const __m256 factor = _mm256_set1_ps(0.999F);
  const double before = core::thread_cpu_seconds();
  for (std::uint64_t step = 0; step < kSteps; ++step) {
    for (__m256& one : sum) {
      one = _mm256_fmadd_ps(one, factor, factor);
    }
  }
  benchmark::DoNotOptimize(sum);
  return 8.0 * kChains * kSteps / (core::thread_cpu_seconds() - before);
}

WEFT_WIDE double chains_of_16() {
  __m512 sum[kChains];
  std::fill(std::begin(sum), std::end(sum), _mm512_set1_ps(1));
  const __m512 factor = _mm512_set1_ps(0.999F);
  const double before = core::thread_cpu_seconds();
  for (std::uint64_t step = 0; step < kSteps; ++step) {
    for (__m512& one : sum) {
      one = _mm512_fmadd_ps(one, factor, factor);
    }
  }
  benchmark::DoNotOptimize(sum);
  return 16.0 * kChains * kSteps / (core::thread_cpu_seconds() - before);
}

// Larger than any cache.
double read_rate(const std::vector<std::uint64_t>& numbers) {
  const double before = core::thread_cpu_seconds();
  benchmark::DoNotOptimize(std::accumulate(numbers.begin(), numbers.end(), std::uint64_t{0}));
  return static_cast<double>(numbers.size() * sizeof(std::uint64_t)) /
         (core::thread_cpu_seconds() - before);
}

MachineLimits measure() {
  const std::vector<std::uint64_t> numbers(std::size_t{256} << 17U, 1);  // 256 MiB
  const bool is_wide = transport::wide_is_available();
  MachineLimits limits;
  for (int i = 0; i < kRepetitions; ++i) {
    limits.read_bytes_per_s = std::max(limits.read_bytes_per_s, read_rate(numbers));
    limits.multiply_adds_per_s =
        std::max(limits.multiply_adds_per_s, is_wide ? chains_of_16() : chains_of_8());
  }
  return limits;
}

}  // namespace

const MachineLimits& machine_limits() {
  static const MachineLimits limits = measure();
  return limits;
}

}  // namespace weft::bench
