#include "transport/distance_fit.h"

#include <algorithm>
#include <bit>
#include <cmath>

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

}  // namespace

struct DistanceFit::Work {
  std::vector<float> distances;  // [rows looked at, columns]
  std::vector<float> sign;       // [points] of the true distance, 0 where there is no point
  std::vector<float> wanted;     // [points] m_p
  std::vector<float> weight;     // [points] root of w_p
  std::vector<float> value;      // [points] sign times what the coefficients give
  std::vector<float> a;          // [points, padded] weighted rows of the points that cost
  std::vector<float> b;          // [points]
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

// Sets the value at kVectors times eight points.
template <std::size_t kVectors>
void DistanceFit::evaluate(Work& work, std::size_t first) const {
  const std::size_t n = points_.size();
  __m256 sum[kVectors];
  for (std::size_t v = 0; v < kVectors; ++v) {
    sum[v] = _mm256_loadu_ps(&mean_[first + kLanes * v]);
  }
  for (std::size_t i = 0; i < components_; ++i) {
    const __m256 factor = _mm256_broadcast_ss(&work.coefficients[i]);
    const float* component = &by_component_[i * n + first];
    for (std::size_t v = 0; v < kVectors; ++v) {
      sum[v] = _mm256_fmadd_ps(factor, _mm256_loadu_ps(component + kLanes * v), sum[v]);
    }
  }
  for (std::size_t v = 0; v < kVectors; ++v) {
    const std::size_t at = first + kLanes * v;
    _mm256_storeu_ps(&work.value[at], _mm256_mul_ps(sum[v], _mm256_loadu_ps(&work.sign[at])));
  }
}

// Collects the weighted rows and errors of the points that cost something; returns how many.
std::size_t DistanceFit::gather(Work& work) const {
  const std::size_t n = points_.size();
  std::size_t first = 0;
  for (; first + 4 * kLanes <= n; first += 4 * kLanes) {
    evaluate<4>(work, first);
  }
  for (; first < n; first += kLanes) {
    evaluate<1>(work, first);
  }
  std::size_t rows = 0;
  for (std::size_t j = 0; j < n; ++j) {
    const float error = work.wanted[j] - work.value[j];
    if (error <= 0 && work.wanted[j] >= kDistanceClamp) {
      continue;
    }
    const float weight = error > 0 ? work.weight[j] : kOvershoot * work.weight[j];
    work.b[rows] = weight * error * work.sign[j];
    float* to = &work.a[rows * padded_];
    const float* from = &by_point_[j * padded_];
    for (std::size_t i = 0; i < padded_; ++i) {
      to[i] = weight * from[i];
    }
    ++rows;
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

// Pixels `first` ... first + 7 of some images.
std::uint64_t wrong_in_eight(const DistanceBasis& basis, std::span<const std::uint8_t> images,
                             std::span<const float> coefficients, std::size_t first) {
  const std::size_t components = basis.variance.size();
  const std::size_t count = coefficients.size() / components;
  __m256 sum[kTogether];
  for (__m256& of_image : sum) {
    of_image = _mm256_loadu_ps(&basis.mean[first]);
  }
  for (std::size_t c = 0; c < components; ++c) {
    const __m256 component = _mm256_loadu_ps(&basis.components[c * basis.pixels + first]);
    for (std::size_t i = 0; i < kTogether; ++i) {
      // The last images stand for those that are missing.
      const float* factor = &coefficients[std::min(i, count - 1) * components + c];
      sum[i] = _mm256_fmadd_ps(_mm256_broadcast_ss(factor), component, sum[i]);
    }
  }
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const int seen = _mm256_movemask_ps(_mm256_cmp_ps(sum[i], _mm256_setzero_ps(), _CMP_GT_OQ));
    const unsigned truth = images[(i * basis.pixels + first) / 8];
    wrong += static_cast<std::uint64_t>(std::popcount(static_cast<unsigned>(seen) ^ truth));
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
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < count; i += kTogether) {
    const std::size_t some = std::min(kTogether, count - i);
    for (std::size_t p = 0; p < basis.pixels; p += kLanes) {
      wrong += wrong_in_eight(basis, images.subspan(i * bytes, some * bytes),
                              coefficients.subspan(i * components, some * components), p);
    }
  }
  return wrong;
}

}  // namespace weft::transport
