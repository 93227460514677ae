#include "transport/distance_fit.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <immintrin.h>

#include "core/check.h"
#include "transport/normal_equations.h"
#include "transport/wide.h"

namespace weft::transport {

namespace {

constexpr int kSteps = 3;
constexpr double kRidge = 1e-5;            // the matrix' entries are about an eighth of w
constexpr float kOvershoot = 0.70710678f;  // root of the weight of what is beyond m_p
// Images of fewer points than this are fitted on all pixels.
constexpr std::uint32_t kLeastResolution = 128;
constexpr std::size_t kLanes = 8;

std::size_t round_up(std::size_t count, std::size_t to) { return (count + to - 1) / to * to; }

// mean + sum of factor_i component_i at points, [components, points].
struct Combination {
  std::span<const float> mean;
  std::span<const float> components;
  std::span<const float> factors;
};

// Times `sign` at kVectors times eight points.
template <std::size_t kVectors>
void evaluate(const Combination& of, std::span<const float> sign, std::size_t first,
              std::span<float> values) {
  const std::size_t n = of.mean.size();
  __m256 sum[kVectors];
  for (std::size_t v = 0; v < kVectors; ++v) {
    sum[v] = _mm256_loadu_ps(&of.mean[first + kLanes * v]);
  }
  for (std::size_t i = 0; i < of.factors.size(); ++i) {
    const __m256 factor = _mm256_broadcast_ss(&of.factors[i]);
    const float* component = &of.components[i * n + first];
    for (std::size_t v = 0; v < kVectors; ++v) {
      sum[v] = _mm256_fmadd_ps(factor, _mm256_loadu_ps(component + kLanes * v), sum[v]);
    }
  }
  for (std::size_t v = 0; v < kVectors; ++v) {
    const std::size_t at = first + kLanes * v;
    _mm256_storeu_ps(&values[at], _mm256_mul_ps(sum[v], _mm256_loadu_ps(&sign[at])));
  }
}

// The same, operation by operation, at kVectors times sixteen points.
template <std::size_t kVectors>
WEFT_WIDE void evaluate_wide(const Combination& of, std::span<const float> sign, std::size_t first,
                             std::span<float> values) {
  constexpr std::size_t kWide = 2 * kLanes;
  const std::size_t n = of.mean.size();
  __m512 sum[kVectors];
  for (std::size_t v = 0; v < kVectors; ++v) {
    sum[v] = _mm512_loadu_ps(&of.mean[first + kWide * v]);
  }
  for (std::size_t i = 0; i < of.factors.size(); ++i) {
    const __m512 factor = _mm512_set1_ps(of.factors[i]);
    const float* component = &of.components[i * n + first];
    for (std::size_t v = 0; v < kVectors; ++v) {
      sum[v] = _mm512_fmadd_ps(factor, _mm512_loadu_ps(component + kWide * v), sum[v]);
    }
  }
  for (std::size_t v = 0; v < kVectors; ++v) {
    const std::size_t at = first + kWide * v;
    _mm512_storeu_ps(&values[at], _mm512_mul_ps(sum[v], _mm512_loadu_ps(&sign[at])));
  }
}

}  // namespace

struct DistanceFit::Work {
  std::vector<float> distances;       // [rows looked at, columns]
  std::vector<float> sign;            // [points] of the true distance, 0 where there is no point
  std::vector<float> wanted;          // [points] m_p
  std::vector<float> weight;          // [points] root of w_p
  std::vector<float> value;           // [points] sign times what the coefficients give
  std::vector<std::uint32_t> costly;  // [points] those that cost, at the beginning
  std::vector<float> a;               // [points, padded] weighted rows of the points that cost
  std::vector<float> b;               // [points]
  std::vector<float> matrix;
  std::vector<float> vector;
  std::vector<double> solution;
  std::span<float> coefficients;
};

DistanceFit::DistanceFit(const DistanceBasis& basis, std::uint32_t resolution)
    : resolution_(resolution),
      row_step_(resolution < kLeastResolution ? 1 : 2),
      column_step_(resolution < kLeastResolution ? 1 : 4),
      components_(basis.variance.size()),
      padded_(round_up(components_, 16)),
      wide_(wide_is_available()),
      transform_(resolution, kDistanceClamp + pixel_bias(resolution)) {
  CHECK_EQ(basis.pixels, resolution * resolution);
  for (std::uint32_t r = 0; r < resolution; r += row_step_) {
    for (std::uint32_t c = r % column_step_; c < resolution; c += column_step_) {
      points_.push_back(r * resolution + c);
    }
  }
  const std::size_t n = points_.size();  // a multiple of eight, because the resolution is
  CHECK_EQ(n % kLanes, 0U);
  by_point_.resize(n * padded_);
  by_component_.resize(components_ * n);
  for (std::size_t j = 0; j < n; ++j) {
    mean_.push_back(basis.mean[points_[j]]);
    for (std::size_t i = 0; i < components_; ++i) {
      const float value = basis.components[i * basis.pixels + points_[j]];
      by_point_[j * padded_ + i] = value;
      by_component_[i * n + j] = value;
    }
  }
}

// The true distances, corrected by the pixels' bias, and what is wanted of them.
void DistanceFit::measure(std::span<const std::uint8_t> image, Work& work) const {
  const std::uint32_t rows = resolution_ / row_step_;
  const float limit = kDistanceClamp + pixel_bias(resolution_);
  transform_.measure(image, row_step_, work.distances);
  std::size_t j = 0;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto row = std::span(work.distances).subspan(std::size_t{r} * resolution_, resolution_);
    for (std::uint32_t c = r * row_step_ % column_step_; c < resolution_; c += column_step_, ++j) {
      const float size = std::abs(row[c]);
      const float y = size - std::min(pixel_bias(resolution_), size / 2);
      const float in_widths = y / kEdgeWidth;
      work.sign[j] = row[c] > 0 ? 1.0f : -1.0f;
      work.wanted[j] = size < limit ? std::min(y, kDistanceClamp) : kDistanceClamp;
      work.weight[j] = 1 / std::sqrt(1 + in_widths * in_widths);
    }
  }
}

// Starts from the components' products with the clamped distances at the points, which stand for
// all pixels.
void DistanceFit::project(Work& work) const {
  const std::size_t n = points_.size();
  const float share =
      static_cast<float>(resolution_) * static_cast<float>(resolution_) / static_cast<float>(n);
  for (std::size_t j = 0; j < n; ++j) {
    work.b[j] = work.sign[j] * work.wanted[j] - mean_[j];
  }
  multiply_transposed(by_point_, work.b, n, work.vector);
  for (std::size_t i = 0; i < components_; ++i) {
    work.coefficients[i] = share * work.vector[i];
  }
}

// Collects the weighted rows and errors of the points that cost something; returns how many.
std::size_t DistanceFit::gather(Work& work) const {
  const std::size_t n = points_.size();
  const Combination combination{mean_, by_component_, work.coefficients};
  std::size_t first = 0;
  for (; wide_ && first + 8 * kLanes <= n; first += 8 * kLanes) {
    evaluate_wide<4>(combination, work.sign, first, work.value);
  }
  for (; first + 4 * kLanes <= n; first += 4 * kLanes) {
    evaluate<4>(combination, work.sign, first, work.value);
  }
  for (; first < n; first += kLanes) {
    evaluate<1>(combination, work.sign, first, work.value);
  }
  std::size_t rows = 0;  // without a branch, which nobody could predict
  for (std::uint32_t j = 0; j < n; ++j) {
    work.costly[rows] = j;
    rows += work.value[j] < work.wanted[j] || work.wanted[j] < kDistanceClamp ? 1 : 0;
  }
  for (std::size_t row = 0; row < rows; ++row) {
    const std::uint32_t j = work.costly[row];
    const float error = work.wanted[j] - work.value[j];
    const float weight = error > 0 ? work.weight[j] : kOvershoot * work.weight[j];
    work.b[row] = weight * error * work.sign[j];
    const __m256 weights = _mm256_set1_ps(weight);
    for (std::size_t i = 0; i < padded_; i += kLanes) {
      _mm256_storeu_ps(&work.a[row * padded_ + i],
                       _mm256_mul_ps(weights, _mm256_loadu_ps(&by_point_[j * padded_ + i])));
    }
  }
  return rows;
}

void DistanceFit::step(std::size_t rows, Work& work) const {
  form_normal_equations(work.a, work.b, rows, wide_, work.matrix, work.vector);
  for (std::size_t i = 0; i < components_; ++i) {
    work.solution[i] = static_cast<double>(work.vector[i]);
  }
  solve_normal_equations(work.matrix, padded_, kRidge, work.solution);
  for (std::size_t i = 0; i < components_; ++i) {
    work.coefficients[i] += static_cast<float>(work.solution[i]);
  }
}

std::vector<float> DistanceFit::coefficients(std::span<const std::uint8_t> images) const {
  const std::size_t bytes = std::size_t{resolution_} * resolution_ / 8;
  const std::size_t n = points_.size();
  CHECK_EQ(images.size() % bytes, 0U);
  const std::size_t count = images.size() / bytes;
  std::vector<float> all(count * components_);
  Work work;
  work.distances.resize(std::size_t{resolution_} / row_step_ * resolution_);
  for (std::vector<float>* per_point :
       {&work.sign, &work.wanted, &work.weight, &work.value, &work.b}) {
    per_point->resize(n);
  }
  work.costly.resize(n);
  work.a.resize(n * padded_);
  work.matrix.resize(padded_ * padded_);
  work.vector.resize(padded_);
  work.solution.resize(components_);
  for (std::size_t i = 0; i < count; ++i) {
    work.coefficients = std::span(all).subspan(i * components_, components_);
    measure(images.subspan(i * bytes, bytes), work);
    project(work);
    for (int k = 0; k < kSteps; ++k) {
      step(gather(work), work);
    }
  }
  return all;
}

namespace {

constexpr std::size_t kTogether = 8;  // images that share the reading of the components

// Up to kTogether images and their coefficients.
struct Some {
  const DistanceBasis& basis;
  std::span<const std::uint8_t> images;
  std::span<const float> coefficients;

  [[nodiscard]] std::size_t components() const { return basis.variance.size(); }
  [[nodiscard]] std::size_t count() const { return coefficients.size() / components(); }
  // The last images stand for those that are missing.
  [[nodiscard]] const float* factor(std::size_t image, std::size_t component) const {
    return &coefficients[std::min(image, count() - 1) * components() + component];
  }
  // The pixels from `first` on as 1 where the sky is seen.
  template <class Word>
  [[nodiscard]] Word truth(std::size_t image, std::size_t first) const {
    Word word = 0;
    std::memcpy(&word, &images[(image * basis.pixels + first) / 8], sizeof word);
    return word;
  }
};

// Pixels `first` ... first + 7.
std::uint64_t wrong_in_eight(const Some& some, std::size_t first) {
  const DistanceBasis& basis = some.basis;
  __m256 sum[kTogether];
  for (__m256& of_image : sum) {
    of_image = _mm256_loadu_ps(&basis.mean[first]);
  }
  for (std::size_t c = 0; c < some.components(); ++c) {
    const __m256 component = _mm256_loadu_ps(&basis.components[c * basis.pixels + first]);
    for (std::size_t i = 0; i < kTogether; ++i) {
      sum[i] = _mm256_fmadd_ps(_mm256_broadcast_ss(some.factor(i, c)), component, sum[i]);
    }
  }
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < some.count(); ++i) {
    const int seen = _mm256_movemask_ps(_mm256_cmp_ps(sum[i], _mm256_setzero_ps(), _CMP_GT_OQ));
    const auto truth = some.truth<std::uint8_t>(i, first);
    wrong += static_cast<std::uint64_t>(std::popcount(static_cast<unsigned>(seen) ^ truth));
  }
  return wrong;
}

// Pixels `first` ... first + 31, likewise.
WEFT_WIDE std::uint64_t wrong_in_many(const Some& some, std::size_t first) {
  constexpr std::size_t kWide = 2 * kLanes;
  const DistanceBasis& basis = some.basis;
  __m512 low[kTogether];
  __m512 high[kTogether];
  for (std::size_t i = 0; i < kTogether; ++i) {
    low[i] = _mm512_loadu_ps(&basis.mean[first]);
    high[i] = _mm512_loadu_ps(&basis.mean[first + kWide]);
  }
  for (std::size_t c = 0; c < some.components(); ++c) {
    const float* component = &basis.components[c * basis.pixels + first];
    const __m512 of_low = _mm512_loadu_ps(component);
    const __m512 of_high = _mm512_loadu_ps(component + kWide);
    for (std::size_t i = 0; i < kTogether; ++i) {
      const __m512 factor = _mm512_set1_ps(*some.factor(i, c));
      low[i] = _mm512_fmadd_ps(factor, of_low, low[i]);
      high[i] = _mm512_fmadd_ps(factor, of_high, high[i]);
    }
  }
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < some.count(); ++i) {
    const std::uint32_t seen =
        _mm512_cmp_ps_mask(low[i], _mm512_setzero_ps(), _CMP_GT_OQ) |
        static_cast<std::uint32_t>(_mm512_cmp_ps_mask(high[i], _mm512_setzero_ps(), _CMP_GT_OQ))
            << kWide;
    wrong += static_cast<std::uint64_t>(std::popcount(seen ^ some.truth<std::uint32_t>(i, first)));
  }
  return wrong;
}

}  // namespace

std::uint64_t wrong_signs(const DistanceBasis& basis, std::span<const std::uint8_t> images,
                          std::span<const float> coefficients) {
  const std::size_t components = basis.variance.size();
  const std::size_t bytes = basis.pixels / 8;
  const std::size_t count = images.size() / bytes;
  CHECK_EQ(coefficients.size(), count * components);
  const bool wide = wide_is_available();
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < count; i += kTogether) {
    const std::size_t held = std::min(kTogether, count - i);
    const Some some{basis, images.subspan(i * bytes, held * bytes),
                    coefficients.subspan(i * components, held * components)};
    std::size_t p = 0;
    for (; wide && p + 4 * kLanes <= basis.pixels; p += 4 * kLanes) {
      wrong += wrong_in_many(some, p);
    }
    for (; p < basis.pixels; p += kLanes) {
      wrong += wrong_in_eight(some, p);
    }
  }
  return wrong;
}

}  // namespace weft::transport
